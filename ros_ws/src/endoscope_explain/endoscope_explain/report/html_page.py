"""report.html: one self-contained page that is read in a minute."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.case import ExplainedCase, Ladder, Place
from endoscope_explain.explanation import Explanation, NamedEffect, Verdict
from endoscope_explain.fit.tolerance import tolerance
from endoscope_explain.fit.whiteness import slips
from endoscope_explain.observe.predicted_signals import RecordedView, view
from endoscope_explain.recording.signals import gear
from endoscope_explain.report.chain_drawing import chain_svg
from endoscope_explain.report.figures.experiment import experiment_figure, unknown_figure
from endoscope_explain.report.figures.ladder import ladder_figure
from endoscope_explain.report.figures.loops import (
    loops_figure,
    shown_plants,
    signals_figure,
    telling_passage,
)
from endoscope_explain.report.figures.timeline import timeline_figure
from endoscope_explain.report.numbers import (
    MODELS,
    PLANTS,
    digits,
    in_degrees,
    judged,
    measurable,
    moving_joints,
    rmse,
    shown,
)
from endoscope_explain.report.report_mapping import EXPERIMENT_FILE
from endoscope_explain.report.sentences import (
    EVIDENCE,
    HEADLINES,
    LEAST_SHARE,
    before_and_after,
    next_step,
    physics_of,
    plain,
    verdict_sentence,
)
from endoscope_explain.search.repeated_motion import motion_repeats

Array = NDArray[np.float64]

GREEN, BLUE, AMBER, RED, GREY = '#136b4f', '#2f6fb7', '#a15c00', '#b3261e', '#52606d'
COLOURS = {
    Verdict.CONSISTENT: GREEN,
    Verdict.PARAMETERS_DIFFER: BLUE,
    Verdict.MISSING_PHYSICS: RED,
    Verdict.SENSOR_FAULT: AMBER,
    Verdict.RECORDING_FAULT: AMBER,
    Verdict.UNKNOWN_PHYSICS: RED,
    Verdict.INSUFFICIENT_DATA: GREY,
}
EFFECTS_TITLE = {
    Verdict.MISSING_PHYSICS: 'What was left out',
    Verdict.SENSOR_FAULT: 'What is at fault',
    Verdict.RECORDING_FAULT: 'What is at fault',
}


def html_page(case: ExplainedCase) -> str:
    """Return the page of a case.

    Parameters
    ----------
    case : ExplainedCase

    Returns
    -------
    str
        HTML that needs no other file.
    """
    explanation = case.explanation
    plants = _plants(explanation)
    recorded = view(case.recording, plants)
    joint = _joint_of_interest(case, recorded)
    j = case.recording.joints.index(joint)
    command = (case.recording.command.time, case.recording.command.values[:, j] / gear())
    # Where a sensor repeats one reading, none of its samples is judged.
    judgeable = any(v.quantity == 'bending' for v in recorded.of_joint(joint))
    passage = telling_passage(recorded, joint) if judgeable else (0.0, case.recording.duration)
    moved = judgeable and joint in moving_joints(case.recording)
    # What is drawn is then what was meant, and shows nothing.
    shaded = () if case.audit.unusable else case.places
    experiment = case.next_experiment
    found = explanation.unknown
    unknown = found if found is not None and found.helps else None
    formula = unknown is not None and unknown.formula_share >= LEAST_SHARE
    ladder = judged(case, case.ladder)
    environment = Environment(
        loader=PackageLoader('endoscope_explain', 'report/templates'),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template('report.html.j2').render(
        name=case.recording.name,
        headline=HEADLINES[case.verdict],
        colour=COLOURS[case.verdict],
        sentence=verdict_sentence(case),
        change=before_and_after(case),
        chain=chain_svg(_guilty(case)),
        places=[_place(place) for place in case.places],
        cut=_cut(case, joint) if case.places else '',
        effects_title=EFFECTS_TITLE.get(case.verdict, 'What was named besides'),
        effects=[_effect(effect) for effect in case.effects],
        joint=joint,
        slipping=[o.joint for o in recorded.observations if slips(o)],
        fitted=bool(explanation.fit),
        differs=bool(case.places),
        plants=[PLANTS[name] for name in shown_plants(recorded.of_joint(joint)[0])],
        mended=case.audit.unusable,
        passage=passage,
        unknown=unknown,
        formula=formula,
        unknown_svg=unknown_figure(unknown, formula) if unknown else '',
        timeline_svg=timeline_figure(recorded, command, joint, shaded) if judgeable else '',
        loops_svg=loops_figure(recorded, command, joint, passage) if moved else '',
        signals_svg=signals_figure(recorded, joint, passage) if moved else '',
        ladder_svg=ladder_figure(ladder) if ladder else '',
        tables=_tables(case, ladder),
        parameters=_parameters(case),
        band=case.band,
        tried=_tried(case),
        not_refitted=_not_refitted(case, recorded),
        next_step=next_step(case),
        experiment=experiment,
        experiment_svg=experiment_figure(experiment) if experiment else '',
        distances=_ranked(experiment.distances) if experiment else [],
        experiment_file=EXPERIMENT_FILE,
        findings=case.audit.findings,
        notes=case.recording.notes,
        duration=f'{case.recording.duration:.1f}',
        joints=case.recording.joints,
        runtime_s=case.runtime_s,
        baseline=case.baseline_name,
        validation=case.validation_name,
        provenance=case.provenance,
        written='improved' if case.effects or unknown else PLANTS[list(plants)[-1]],
    )


def _plants(explanation: Explanation) -> dict[str, Any]:
    """The plants of an explanation by name, each once."""
    plants = {'nominal': explanation.nominal}
    if explanation.fit:
        plants['refitted'] = explanation.refitted
        if explanation.augmented != explanation.refitted:
            plants['augmented'] = explanation.augmented
    return plants


def _joint_of_interest(case: ExplainedCase, recorded: RecordedView) -> str:
    named = [e.joint for e in case.effects] + [p.joint for p in case.places]
    if named:
        return named[0]
    moved = [np.ptp(case.recording.command.values[:, j]) for j in range(len(recorded.joints))]
    return case.recording.joints[int(np.argmax(moved))]


def _guilty(case: ExplainedCase) -> dict[str, list[str]]:
    guilty: dict[str, list[str]] = {}
    for effect in case.effects:
        guilty.setdefault(effect.stage, []).append(f'{effect.id} ({effect.joint})')
    if not guilty:
        word = 'unknown' if case.verdict is Verdict.UNKNOWN_PHYSICS else str(case.verdict)
        for place in case.places:
            guilty.setdefault(place.stage, []).append(f'{word.replace("_", " ")} ({place.joint})')
    return guilty


def _place(place: Place) -> dict[str, Any]:
    low, high = place.band_hz
    shown = ', '.join(f'{a:.1f} … {b:.1f}' for a, b in place.intervals[:6])
    more = len(place.intervals) - 6
    return {
        'stage': place.stage,
        'joint': place.joint,
        # The audit's findings have no state of the rig: their text stands above.
        'regime': place.regime if place.shares else '',
        'bars': [{'signal': plain(s), 'share': place.shares.get(s, 0.0)} for s in place.signals],
        'intervals': shown + (f' s and {more} more' if more > 0 else ' s') if shown else '',
        'band': f'{low:.2g} … {high:.2g} Hz' if high > 0 else '',
    }


def _cut(case: ExplainedCase, joint: str) -> str:
    cut = next((c for c in case.cuts if c.joint == joint), None)
    if cut is None or cut.by_command < 2.0:
        return ''
    where = 'before' if cut.before_the_motor else 'behind'
    return (
        f'Driven by the measured motor, the refitted plant is off by {cut.by_motor:.1f} instead of '
        f'{cut.by_command:.1f} times the noise. Most of what is missing acts {where} the encoder.'
    )


def _effect(effect: NamedEffect) -> dict[str, Any]:
    rows = [shown(name, e) for name, e in measurable(effect).items()]
    return {
        'id': effect.id,
        'joint': effect.joint,
        'physics': physics_of(effect),
        'equation': effect.equation,
        'source': effect.source,
        'alternatives': effect.alternatives,
        'rows': rows or [None],
        'probability': f'{100 * effect.probability:.0f} %',
        'evidence': [
            {'key': key, 'value': digits(value), 'meaning': EVIDENCE.get(key, '')}
            for key, value in effect.evidence.items()
        ],
    }


def _tables(case: ExplainedCase, ladder: Ladder) -> list[dict[str, Any]]:
    tables = [_table(case, 'held-out blocks of this recording', ladder)] if ladder else []
    if case.validation:
        title = f'second recording: {case.validation_name}'
        tables.append(_table(case, title, judged(case, case.validation)))
    return tables


def _table(case: ExplainedCase, title: str, ladder: Ladder) -> dict[str, Any]:
    rows = []
    for signal in next(iter(ladder.values())):
        fits = [fits.get(signal) for fits in ladder.values()]
        least = min(f.rmse for f in fits if f is not None)
        texts = [('', '') if f is None else rmse(signal, f) for f in fits]
        cells = [
            {'text': '', 'best': False}
            if f is None
            else {'text': f'{text} ({digits(f.ratio)})', 'best': f.rmse <= 1.02 * least}
            for f, (text, _) in zip(fits, texts, strict=True)
        ]
        rows.append({'signal': plain(signal), 'unit': texts[0][1], 'cells': cells})
    return {'title': title, 'models': [MODELS[name] for name in ladder], 'rows': rows}


def _parameters(case: ExplainedCase) -> list[dict[str, Any]]:
    """The numbers of the plant: described, fitted, interval and tolerance."""
    rows = []
    for joint, estimates in case.explanation.parameters.items():
        for name, e in estimates.items():
            low, high = tolerance(name, e.nominal, case.band)
            _, _, factor = in_degrees(name, e.unit)
            rows.append(
                {
                    'joint': joint,
                    'number': shown(name, e),
                    'described': digits(factor * e.nominal),
                    'tolerance': f'{digits(factor * low)} … {digits(factor * high)}',
                    'outside': not low <= e.value <= high,
                }
            )
    return rows


def _tried(case: ExplainedCase) -> list[dict[str, str]]:
    """All that was refitted, joint by joint: scores of two joints have nothing to do."""
    rows = []
    for joint in case.recording.joints:
        ranked = [c for c in case.explanation.candidates if c.joint == joint]
        rows += [
            {
                'joint': joint,
                'name': (' + '.join(c.effects) or 'no effect')
                + (', numbers beyond their tolerance' if c.beyond_band else ''),
                'score': f'{c.score:.1f}',
                'behind': f'{c.score - ranked[0].score:.1f}',
                'misfit': f'{np.sqrt(c.misfit):.2f}',
            }
            for c in ranked
        ]
    return rows


def _not_refitted(case: ExplainedCase, recorded: RecordedView) -> list[dict[str, Any]]:
    """Effects that no composition of a joint holds, and why."""
    found = []
    for observation in recorded.observations:
        sets = [c.effects for c in case.explanation.candidates if c.joint == observation.joint]
        if not any(sets):
            found.append({'joint': observation.joint, 'less': [], 'late': []})
            continue
        known = {effect for effects in sets for effect in effects}
        rest = [e for e in CATALOGUE.values() if e.id not in known and not e.traits.audited]
        once = not motion_repeats(observation)
        late = [e.id for e in rest if once and e.traits.depends_on_time]
        found.append(
            {
                'joint': observation.joint,
                'less': [e.id for e in rest if e.id not in late],
                'late': late,
            }
        )
    return found


def _ranked(distances: Mapping[str, float]) -> list[tuple[str, float]]:
    return sorted(distances.items(), key=lambda item: -item[1])

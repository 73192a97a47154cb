"""report.html: one self-contained page that is read in a minute."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from numpy.typing import NDArray

from endoscope_explain.case import ExplainedCase, Ladder, Place
from endoscope_explain.explanation import NamedEffect, Verdict
from endoscope_explain.predicted_signals import RecordedView, view
from endoscope_explain.recording.signals import gear
from endoscope_explain.report.chain_drawing import chain_svg
from endoscope_explain.report.figures.experiment import experiment_figure, unknown_figure
from endoscope_explain.report.figures.ladder import RUNGS, ladder_figure, parameters_figure
from endoscope_explain.report.figures.loops import (
    loops_figure,
    signals_figure,
    telling_passage,
)
from endoscope_explain.report.figures.timeline import timeline_figure
from endoscope_explain.report.report_mapping import EXPERIMENT_FILE
from endoscope_explain.report.sentences import HEADLINES, verdict_sentence

Array = NDArray[np.float64]

SHORT_TITLES = {
    'nominal': 'nominal',
    'refitted': 'refitted',
    'augmented': 'improved',
    'gaussian_process': 'Gaussian process',
    'neural_network': 'neural network',
}

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
    plants = {'nominal': explanation.nominal}
    if explanation.fit:
        plants |= {'refitted': explanation.refitted, 'augmented': explanation.augmented}
    recorded = view(case.recording, plants)
    joint = _joint_of_interest(case, recorded)
    j = case.recording.joints.index(joint)
    command = (case.recording.command.time, case.recording.command.values[:, j] / gear())
    # Where a sensor repeats one reading, none of its samples is judged.
    judged = any(v.quantity == 'bending' for v in recorded.of_joint(joint))
    passage = telling_passage(recorded, joint) if judged else (0.0, case.recording.duration)
    experiment, unknown = case.next_experiment, explanation.unknown
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
        chain=chain_svg(_guilty(case)),
        places=[_place(place) for place in case.places],
        cut=_cut(case, joint),
        effects=[_effect(effect) for effect in case.effects],
        joint=joint,
        fitted=bool(explanation.fit),
        mended=case.audit.unusable,
        passage=passage,
        unknown=unknown,
        unknown_svg=unknown_figure(unknown) if unknown else '',
        timeline_svg=timeline_figure(recorded, command, joint, case.places) if judged else '',
        loops_svg=loops_figure(recorded, command, joint, passage) if judged else '',
        signals_svg=signals_figure(recorded, joint, passage) if judged else '',
        ladder_svg=ladder_figure(case.ladder) if case.ladder['nominal'] else '',
        tables=_tables(case, recorded),
        parameters_svg=parameters_figure(explanation.parameters) if explanation.parameters else '',
        candidates=_candidates(case),
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
    )


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
        'regime': place.regime,
        'bars': [{'signal': s, 'share': place.shares.get(s, 0.0)} for s in place.signals],
        'intervals': shown + (f' s and {more} more' if more > 0 else ' s') if shown else '',
        'band': f'{low:.2g} … {high:.2g} Hz' if high > 0 else '',
    }


def _cut(case: ExplainedCase, joint: str) -> str:
    cut = next((c for c in case.cuts if c.joint == joint), None)
    if cut is None or cut.by_command < 2.0:
        return ''
    where = 'before' if cut.before_the_motor else 'behind'
    return (
        f'Driven by the measured motor instead of the command, the refitted plant misses wires and '
        f'tip of {joint} by {cut.by_motor:.1f} instead of {cut.by_command:.1f} times the noise: '
        f'most of what is missing acts {where} the encoder.'
    )


def _effect(effect: NamedEffect) -> dict[str, Any]:
    rows = [
        {
            'name': name,
            'value': f'{e.value:.4g}',
            'low': f'{e.low:.4g}',
            'high': f'{e.high:.4g}',
            'unit': e.unit,
        }
        for name, e in effect.parameters.items()
    ] or [{'name': '', 'value': '', 'low': '', 'high': '', 'unit': ''}]
    return {
        'id': effect.id,
        'joint': effect.joint,
        'equation': effect.equation,
        'source': effect.source,
        'alternatives': effect.alternatives,
        'rows': rows,
        'probability': f'{100 * effect.probability:.0f} %',
    }


def _tables(case: ExplainedCase, recorded: RecordedView) -> list[dict[str, Any]]:
    units = {name: one.unit for name, one in recorded.signals.items()}
    tables = [_table('held-out blocks of this recording', case.ladder, units)]
    if case.validation:
        tables.append(_table(f'second recording: {case.validation_name}', case.validation, units))
    return tables


def _table(title: str, ladder: Ladder, units: Mapping[str, str]) -> dict[str, Any]:
    rungs = [name for name in RUNGS if name in ladder]
    rows = []
    for signal in ladder[rungs[0]]:
        fits = [ladder[rung].get(signal) for rung in rungs]
        least = min(f.rmse for f in fits if f is not None)
        cells = [
            {'text': '', 'best': False}
            if f is None
            else {'text': f'{f.rmse:.4g} ({f.ratio:.2f})', 'best': f.rmse <= 1.02 * least}
            for f in fits
        ]
        rows.append(
            {
                'signal': signal.replace('/measured_js', ''),
                'unit': units.get(signal, ''),
                'cells': cells,
            }
        )
    return {'title': title, 'rungs': [SHORT_TITLES[r] for r in rungs], 'rows': rows}


def _candidates(case: ExplainedCase, most: int = 4) -> list[dict[str, str]]:
    """The best of each joint: scores of two joints have nothing to do with each other."""
    rows = []
    for joint in case.recording.joints:
        ranked = [c for c in case.explanation.candidates if c.joint == joint][:most]
        rows += [
            {
                'joint': joint,
                'name': (' + '.join(c.effects) or 'nominal, refitted')
                + (' beyond the band' if c.beyond_band else ''),
                'score': f'{c.score:.1f}',
                'behind': f'{c.score - ranked[0].score:.1f}',
                'misfit': f'{np.sqrt(c.misfit):.2f}',
            }
            for c in ranked
        ]
    return rows


def _ranked(distances: Mapping[str, float]) -> list[tuple[str, float]]:
    return sorted(distances.items(), key=lambda item: -item[1])

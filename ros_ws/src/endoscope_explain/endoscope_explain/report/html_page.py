"""report.html: one self-contained page that is read in a minute."""

from typing import Any

import numpy as np

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import Argument
from endoscope_explain.case import EXPERIMENT_FILE, ExplainedCase, Ladder
from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.fit.evidence import slipping
from endoscope_explain.fit.free_parameters import tolerance
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.observe.predicted_signals import RecordedView, view
from endoscope_explain.observe.revisits import motion_repeats
from endoscope_explain.report import left_open, numbers, sentences
from endoscope_explain.report.figures import experiment_figure, ladder_figure, unknown_figure
from endoscope_explain.report.left_open import visited_once
from endoscope_explain.report.passage import (
    passage_figure,
    state_of,
    telling_passage,
    telling_signals,
    timeline_figure,
)
from endoscope_pages import render_page

COLOURS = {
    Verdict.CONSISTENT: 'good',
    Verdict.PARAMETERS_DIFFER: 'curve-1',
    Verdict.MISSING_PHYSICS: 'finding',
    Verdict.SENSOR_FAULT: 'curve-5',
    Verdict.RECORDING_FAULT: 'curve-5',
    Verdict.UNKNOWN_PHYSICS: 'finding',
    Verdict.INSUFFICIENT_DATA: 'quiet',
}
"""Names of look.css."""

EFFECTS_TITLE = {
    Verdict.MISSING_PHYSICS: 'What was left out',
    Verdict.SENSOR_FAULT: 'What is at fault',
    Verdict.RECORDING_FAULT: 'What is at fault',
}
CHAIN = {
    'command': 'motor/servo_jp',
    'actuator': 'servo, motor/measured_js',
    'transmission': 'wires and sheath, wires/measured_js',
    'joint': 'bending section, the tip',
    'sensing': 'load cells, tracker',
    'recording': 'clocks, samples',
}
"""From command to recording: each stage by its one name, and what it is or is read of it."""

FAR_OFF = 2.0
"""Misfit over noise from which on a signal is marked: what is not noise is more than noise then."""
DRAWINGS = ('unknown', 'timeline', 'loops', 'ladder', 'experiment')


def html_page(case: ExplainedCase) -> str:
    """Return the page of a case: HTML that needs no other file."""
    explanation = case.explanation
    recorded = view(case.recording, _plants(explanation))
    joint = _joint_of_interest(case, recorded)
    found = explanation.unknown
    unknown = found if found is not None and found.helps else None
    ladder = numbers.judged(case, case.ladder)
    return render_page(
        'endoscope_explain',
        'report/templates/report.html.j2',
        filters={'digits': numbers.digits, 'plain': sentences.plain},
        case=case,
        headline=sentences.HEADLINES[case.verdict],
        colour=COLOURS[case.verdict],
        sentence=sentences.verdict_sentence(case),
        change=sentences.before_and_after(case),
        reservations=sentences.reservations(case),
        chain=CHAIN,
        responsible=_responsible(case),
        cut=_cut(case, joint) if case.places else '',
        effects_title=_effects_title(case),
        numbers_of=numbers.numbers_of,
        label=sentences.label,
        how_sure=sentences.how_sure,
        far_off=FAR_OFF,
        what_is_open=left_open.what_is_open,
        physics_of=sentences.physics_of,
        meaning=sentences.EVIDENCE,
        joint=joint,
        slipping={o.joint: rms for o in recorded.observations if (rms := slipping(o))},
        plants=[numbers.PLANTS[name] for name in recorded.of_joint(joint)[0].predicted],
        unknown=unknown,
        formula=unknown is not None and unknown.formula_share >= sentences.LEAST_SHARE,
        drawings=_drawings(case, recorded, joint, ladder),
        tables=_tables(case, ladder),
        once=visited_once(case),
        parameters=_parameters(case),
        fitting=sentences.fitting_sentences(case),
        tried=_tried(case),
        not_refitted=[_not_refitted(case, o) for o in recorded.observations],
        next_step=sentences.next_step(case),
        experiment_file=EXPERIMENT_FILE,
        written='improved'
        if case.effects or unknown
        else numbers.PLANTS[list(_plants(explanation))[-1]],
    )


def _effects_title(case: ExplainedCase) -> str:
    if case.effects and all(effect.doubtful for effect in case.effects):
        return 'What fits this recording alone'
    return EFFECTS_TITLE.get(case.rest, 'What was named besides')


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


def _drawings(
    case: ExplainedCase, recorded: RecordedView, joint: str, ladder: Ladder
) -> dict[str, Any]:
    """The drawings that can be made, as HTML by their names, and the passage that they show."""
    drawn: dict[str, Any] = dict.fromkeys(DRAWINGS, '')
    # Where a sensor repeats one reading, none of its samples is judged.
    if any(v.quantity == 'bending' for v in recorded.of_joint(joint)):
        j = case.recording.joints.index(joint)
        asked = case.recording.command
        command = (asked.time, asked.values[:, j] / case.recording.gear)
        # What is drawn is as corrected, and shows no mistake.
        mistaken = bool(case.audit.mistakes())
        shaded = tuple(p for p in case.places if p.shares or not mistaken)
        drawn['timeline'] = timeline_figure(recorded, command, joint, shaded)
        if joint in numbers.moving_joints(case.recording):
            views = telling_signals(recorded, joint)
            passage = drawn['passage'] = telling_passage(views)
            over = state_of(recorded, joint, command, _argument(case, joint))
            drawn['loops'] = passage_figure(views, over, passage)
            drawn['loops_title'] = (
                f'Hysteresis loops of {joint}'
                if over.words == 'command'
                else f'{joint} over the {over.words}'
            )
    if case.explanation.unknown is not None:
        drawn['unknown'] = unknown_figure(case.explanation.unknown)
    if ladder:
        drawn['ladder'] = ladder_figure(ladder)
    if case.next_experiment is not None:
        drawn['experiment'] = experiment_figure(case.next_experiment)
    return drawn


def _argument(case: ExplainedCase, joint: str) -> Argument | None:
    """What the first thing that is missing from a joint depends on; None where nothing is."""
    term = case.explanation.unknown
    if term is not None and term.helps and term.joint == joint:
        return term.there.argument
    effect = next((e for e in case.effects if e.joint == joint), None)
    places = () if effect is None else effect.definition.traits.families
    return FUNCTIONS[places[0]].argument if places else None


def _responsible(case: ExplainedCase) -> dict[str, list[str]]:
    """What was found in each stage of the chain."""
    found: dict[str, list[str]] = {}
    for effect in case.effects:
        found.setdefault(effect.stage, []).append(f'{sentences.label(effect)} ({effect.joint})')
    mistaken = case.audit.mistakes()
    places = case.places[: len(mistaken)] if found else case.places
    for index, place in enumerate(places):
        verdict = case.verdict if index < len(mistaken) else case.rest
        word = 'unknown' if verdict is Verdict.UNKNOWN_PHYSICS else str(verdict)
        text = f'{word.replace("_", " ")} ({place.joint})'
        if text not in found.setdefault(place.stage, []):
            found[place.stage].append(text)
    return found


def _cut(case: ExplainedCase, joint: str) -> str:
    cut = next((c for c in case.cuts if c.joint == joint), None)
    if cut is None or cut.by_command < 2.0:
        return ''
    where = 'before' if cut.before_the_motor else 'behind'
    return (
        f'Driven by the measured motor, the refitted plant is off by {cut.by_motor:.1f} instead of '
        f'{cut.by_command:.1f} times the noise. Most of what is missing acts {where} the encoder.'
    )


def _tables(case: ExplainedCase, ladder: Ladder) -> list[dict[str, Any]]:
    titled = {'held-out parts of this recording': ladder}
    titled[f'second recording: {case.validation_name}'] = numbers.judged(case, case.validation)
    return [
        {
            'title': title,
            'models': [numbers.PLANTS[name] for name in models],
            'rows': [_row(signal, models) for signal in next(iter(models.values()))],
        }
        for title, models in titled.items()
        if models
    ]


def _kind(ratio: float) -> str:
    """How the best of a row is marked, by what it leaves over noise."""
    return 'bad' if ratio > FAR_OFF else 'best'


def _row(signal: str, models: Ladder) -> dict[str, Any]:
    """What each model leaves of a signal; empty where one does not predict it."""
    fits = [fits.get(signal) for fits in models.values()]
    least = min(f.rmse for f in fits if f is not None)
    texts = [('', '') if f is None else numbers.rmse(signal, f) for f in fits]
    cells = [
        {
            'text': f'{text} ({numbers.digits(f.ratio)})' if f else '',
            'kind': '' if f is None or f.rmse > 1.02 * least else _kind(f.ratio),
        }
        for f, (text, _) in zip(fits, texts, strict=True)
    ]
    return {'signal': signal, 'unit': texts[0][1], 'cells': cells}


def _parameters(case: ExplainedCase) -> list[dict[str, Any]]:
    """The numbers of the plant: described, fitted, interval and tolerance."""
    rows = []
    for joint, estimates in case.explanation.parameters.items():
        for name, e in estimates.items():
            _, _, factor = numbers.in_degrees(name, e.unit)
            low, high = tolerance(name, e.nominal, case.inputs.sources.band)
            reach = f'{numbers.digits(factor * low)} … {numbers.digits(factor * high)}'
            rows.append(
                {
                    'joint': joint,
                    'number': numbers.shown(name, e),
                    'known': sentences.what_is_known(e),
                    'described': numbers.digits(factor * e.nominal),
                    'tolerance': reach,
                    'outside': not low <= e.value <= high,
                }
            )
    return rows


def _tried(case: ExplainedCase) -> list[dict[str, Any]]:
    """All that was refitted, joint by joint: scores of two joints have nothing to do."""
    rows = []
    for joint in case.recording.joints:
        ranked = [c for c in case.explanation.candidates if c.joint == joint]
        rows += [
            {'candidate': c, 'behind': c.score - ranked[0].score, 'misfit': np.sqrt(c.misfit)}
            for c in ranked
        ]
    return rows


def _not_refitted(case: ExplainedCase, observation: JointObservation) -> dict[str, Any]:
    """Effects that no candidate of a joint has, and why."""
    sets = [c.effects for c in case.explanation.candidates if c.joint == observation.joint]
    known = {effect for effects in sets for effect in effects}
    rest = [e for e in CATALOGUE.values() if e.id not in known and not e.traits.audited]
    once = not motion_repeats(observation)
    late = [e.id for e in rest if once and e.traits.depends_on_time]
    less = [e.id for e in rest if e.id not in late]
    return {'joint': observation.joint, 'any': bool(known), 'less': less, 'late': late}

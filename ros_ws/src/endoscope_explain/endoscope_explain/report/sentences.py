"""What was found, in sentences of at most twenty words, and as lines for the terminal."""

import math
from collections.abc import Sequence

from endoscope_core.physics.effects import CATALOGUE, KNOWN
from endoscope_explain.case import ExplainedCase, Mismatch, changed_parameters
from endoscope_explain.explanation import NamedEffect, NominalEstimate, Verdict
from endoscope_explain.recording import axis
from endoscope_explain.report.left_open import function_of, in_words, visited_once
from endoscope_explain.report.numbers import (
    PLANTS,
    digits,
    form,
    in_degrees,
    judged,
    numbers_of,
    shown,
)

HEADLINES = {
    Verdict.CONSISTENT: 'Simulation and recording agree',
    Verdict.PARAMETERS_DIFFER: 'Only parameters differ',
    Verdict.MISSING_PHYSICS: 'The simulation leaves out physics',
    Verdict.SENSOR_FAULT: 'A sensor is at fault',
    Verdict.RECORDING_FAULT: 'The recording is at fault',
    Verdict.UNKNOWN_PHYSICS: 'Physics outside the catalogue',
    Verdict.INSUFFICIENT_DATA: 'The recording cannot decide',
}
EVIDENCE = {
    'gain': 'log evidence that it adds, in nats',
    'p_value': 'share of rigs without it in which as much is found',
    'second_p_value': 'chance that it predicts the second recording no better',
    'margin': 'nats by which it adds more than the best other name',
    'form': 'nats by which an error of form may mislead between names',
    'as_formula': '1 where the plant has its formula, 0 where it has a fitted function',
    'explained': 'share of the excess misfit that is gone with all that was found',
    'count': 'samples that show it',
    'gaps': 'number of gaps',
    'missing_s': 'seconds without samples',
    'jitter_s': 'rms jitter of the stamps in seconds',
    'longest_s': 'longest stretch in seconds',
    'worst_s': 'largest step back in seconds',
    'z': 'standard deviations from zero',
    'factor': 'reading of one SI unit',
    'misfit': 'share that no lag, offset and scale make of what the plant gives, as recorded',
    'misfit_corrected': 'the same, as corrected',
    'per_second': 'stamps of one second',
}
"""What each number of an effect's evidence is."""
LEAST_SHARE = 0.5
"""A formula that does less of what the function does than this is no help."""
MOST_NAMED = 2
STAYS = 1.2
"""Misfit over noise from which on a signal counts as off; of a thousand samples, noise alone
leaves 1.05 once in a hundred."""


def verdict_sentence(case: ExplainedCase) -> str:
    """Say in one sentence what was found."""
    mistakes = case.audit.mistakes()
    return f'{_capital(mistakes[0].text)}.' if mistakes else _sentence_of_rest(case)


def _sentence_of_rest(case: ExplainedCase) -> str:
    if case.rest is Verdict.INSUFFICIENT_DATA:
        return 'The rig moves too little, or too little was recorded, to distinguish causes.'
    if case.rest is Verdict.CONSISTENT:
        return f'The described plant predicts the recording of {_all(case.recording.joints)}.'
    if case.rest is Verdict.PARAMETERS_DIFFER:
        return _differing(case)
    if case.rest is Verdict.UNKNOWN_PHYSICS:
        return _unknown(case)
    named = _not_doubted(case)
    if case.effects and not named:
        return _doubt(case, case.effects[0])
    if named:
        missing = case.rest is Verdict.MISSING_PHYSICS
        begin = 'The simulation leaves out' if missing else 'The recording shows'
        return f'{begin} {_all(named)}.'
    return f'{_capital(case.audit.apart_from_mistakes().faults()[0].text)}.'


def _not_doubted(case: ExplainedCase) -> list[str]:
    """The first effects that no second recording puts in doubt, and how many more there are."""
    sure = [e for e in case.effects if not e.doubtful]
    kinds = [(e.id, e.joint) for e in sure]
    named = [
        f'{_named(e)} ({", ".join(form(e))})' if kinds.count((e.id, e.joint)) > 1 else _named(e)
        for e in sure[:MOST_NAMED]
    ]
    more = len(sure) - len(named)
    return [*named, f'{more} more'] if more else named


def physics_of(effect: NamedEffect) -> str:
    """What an effect does, and in which form."""
    forms = form(effect)
    physics = f'{effect.definition.physics.rstrip(".")}.'
    return f'{physics} Here: {", ".join(forms)}.' if forms else physics


def how_sure(effect: NamedEffect) -> str:
    """How often a name given as clearly is right; empty where that was not measured."""
    if math.isnan(effect.probability):
        return ''
    of_hundred = min(round(100.0 * effect.probability), 99)
    return f'On simulated rigs, {of_hundred} of a hundred names as clear were right.'


def where(place: Mismatch) -> str:
    """Where a mismatch shows: in which state of the rig, or in which signals."""
    how = place.regime if place.shares else ' and '.join(map(plain, place.signals))
    return f'{place.stage} of {place.joint}, {how}'


def differing(case: ExplainedCase) -> dict[tuple[str, str], NominalEstimate]:
    """Parameters that changed, by joint and name, the largest change of each joint first."""
    return {
        (joint, name): e
        for joint, estimates in case.explanation.parameters.items()
        for name, e in changed_parameters(estimates).items()
    }


def before_and_after(case: ExplainedCase) -> str:
    """Say how well the worst signal is predicted before and after; empty where nothing is."""
    plants = judged(case, case.ladder)
    if not plants.get('nominal'):
        return ''
    signal, before = max(plants['nominal'].items(), key=lambda item: item[1].ratio)
    best = 'augmented' if 'augmented' in plants else 'refitted'
    after = plants[best][signal].ratio if best in plants else before.ratio
    return (
        f'{plain(signal)} is off by {digits(before.ratio)} times its noise with the described '
        f'plant, by {digits(after)} times with the {PLANTS[best]} one.'
    )


def reservations(case: ExplainedCase) -> list[str]:
    """Say what else has to be known: of a corrected recording, and of what is left over."""
    mistakes = case.audit.mistakes()
    sentences: list[str] = []
    if len(mistakes) > 1:
        sentences += [f'{_capital(finding.text)}.' for finding in mistakes[1:]]
    if mistakes:
        frozen = all(finding.id == 'frozen' for finding in mistakes)
        begin = 'Of what is not frozen' if frozen else 'As corrected'
        sentences.append(f'{begin}: {_sentence_of_rest(case)}')
    left_over = [] if case.explanation.adequate else case.audit.findings
    doubtful = [e for e in case.effects if e.doubtful]
    if len(doubtful) == len(case.effects) and case.rest is not Verdict.UNKNOWN_PHYSICS:
        # The first one is the verdict's sentence.
        doubtful = doubtful[1:]
    sentences += [_doubt(case, effect) for effect in doubtful]
    unlike = (f for f in left_over if f.id == 'unlike_the_plant')
    sentences += [f'{_capital(finding.text)}. {_capital(finding.remedy)}.' for finding in unlike]
    others = case.inputs.mistakes_of_others
    sentences += [f'{_capital(other)}. It was used as corrected.' for other in others]
    if case.rest in (Verdict.CONSISTENT, Verdict.INSUFFICIENT_DATA):
        return sentences
    for joint in case.explanation.contests:
        left = case.explanation.left_open(joint)
        if any(name in KNOWN for names in left for name in names):
            sentences.append(f'Whether {joint} lacks something more stays open: {in_words(left)}.')
    sentences += [
        f'The improved plant has {function_of(place)} on {joint} as well: it repairs no more than '
        'another form of the plant would leave.'
        for joint, place in case.explanation.repairs_form
    ]
    plants = list(judged(case, case.ladder).values())
    best = plants[-1] if plants else {}
    # Signals that stay off with the best plant.
    off = {signal: fit.ratio for signal, fit in best.items() if fit.ratio > STAYS}
    if off:
        signal, ratio = max(off.items(), key=lambda item: item[1])
        more = ''
        if len(off) > 1:
            more = f', and {len(off) - 1} more {"are" if len(off) > 2 else "is"} off'
        sentences.append(
            f'{_capital(plain(signal))} is still off by {digits(ratio)} times its noise{more}. '
            'The form differs, or something else is missing too.'
        )
    besides = {key: e for key, e in differing(case).items() if not e.in_band}
    if besides and case.rest is not Verdict.PARAMETERS_DIFFER:
        shown_ones = [_one_differing(*key, e) for key, e in besides.items()]
        sentences.append(f'Besides, {_all(shown_ones)}.')
    return sentences


def what_is_known(e: NominalEstimate) -> str:
    """Why a fitted number is none that the recording shows; empty where it is."""
    if e.together_with:
        return f'only together with {e.together_with}'
    if not e.shown:
        return 'this recording does not show it'
    return f'at a bound: {_beyond(e)}' if e.at_bound else ''


def not_shown(case: ExplainedCase) -> list[str]:
    """Which numbers of the plant the recording does not show; empty where it shows all."""
    sentences = []
    for joint, estimates in case.explanation.parameters.items():
        hidden = [n for n, e in estimates.items() if not (e.shown or e.together_with)]
        if hidden:
            sentences.append(f'This recording does not show {_all(hidden)} of {joint}.')
        pairs = {n: e.together_with for n, e in estimates.items() if e.together_with}
        # Two that name each other make one sentence.
        once = [n for n, other in pairs.items() if pairs.get(other) != n or n < other]
        sentences += [f'It shows {n} of {joint} only together with {pairs[n]}.' for n in once]
    return sentences


def fitting_sentences(case: ExplainedCase) -> list[str]:
    """Say how each joint's fit ended, and which numbers are at a bound."""
    sentences = []
    for joint, each in case.explanation.fitting.items():
        how = 'converged' if each.converged else 'did not converge: its numbers are not final'
        text = f'The fit of {joint} {how} ({each.steps} steps; {each.reason}).'
        if each.at_bounds:
            text += f' At a bound: {_all(each.at_bounds)}.'
        sentences.append(text)
    return sentences


def plain(signal: str) -> str:
    """A signal's name as a person writes it."""
    return signal.replace('/measured_js', '')


def next_step(case: ExplainedCase) -> str:
    """Say what to do next."""
    if case.verdict is Verdict.INSUFFICIENT_DATA:
        return 'Record at least 10 s in which the motors move both ways, such as a calibration.'
    if case.audit.mistakes():
        return f'{_capital(case.audit.mistakes()[0].remedy)}.'
    if case.next_experiment is not None:
        laws = case.next_experiment.separates
        gain = f'decides between {_all(laws)}' if len(laws) > 1 else f'narrows {laws[0]}'
        return f'Have the master play next_experiment.csv: it {gain}.'
    confounded = [(e.id, name) for e in case.effects for name in e.alternatives if name in KNOWN]
    if confounded:
        pair = ' from '.join(confounded[0])
        return f'Run again without --quick for the motion that distinguishes {pair}.'
    if any(e.doubtful for e in case.effects):
        return 'Explain both recordings with --same-physics: what is named then explains both.'
    if case.verdict is Verdict.CONSISTENT:
        return 'Continue with the described plant.'
    if case.verdict is Verdict.SENSOR_FAULT:
        return 'Repair or calibrate the sensor, and record again.'
    if case.verdict is Verdict.RECORDING_FAULT and case.audit.faults():
        return 'Repair the recording, or continue: nothing was judged where it is wrong.'
    if not case.explanation.adequate and not case.effects and case.explanation.unknown is None:
        return (
            'Do not continue with plant.yaml: what is missing was not found. Look where it shows.'
        )
    if not case.validation:
        return 'Judge plant.yaml on a second recording: give one with --validate.'
    return 'Continue with plant.yaml.'


def _differing(case: ExplainedCase) -> str:
    changed = differing(case)
    if not changed:
        return 'Parameters differ within their tolerance.'
    (joint, name), e = next(iter(changed.items()))
    more = f', and {len(changed) - 1} more differ' if len(changed) > 1 else ''
    others = [name for name in case.explanation.instead(joint) if name in CATALOGUE]
    rival = f'; {others[0]} would explain as much' if others else ''
    return f'{_one_differing(joint, name, e)}{more}{rival}.'


def _one_differing(joint: str, name: str, e: NominalEstimate) -> str:
    name, unit, factor = in_degrees(name, e.unit)
    value, unit = digits(factor * e.value), f' {unit}' if unit else ''
    value = f'{value}{unit} {_beyond(e)}' if e.at_bound else value
    return f'{name} of {joint} is {value} instead of {digits(factor * e.nominal)}{unit}'


def _beyond(e: NominalEstimate) -> str:
    """On which side of its bound a number lies."""
    return 'or more' if e.value > e.nominal else 'or less'


def _unknown(case: ExplainedCase) -> str:
    term = case.explanation.unknown
    if term is None or not term.helps:
        shown = [place.joint for place in case.places if place.shares]
        joint = [*shown, *case.recording.joints][0]
        named = _not_doubted(case)
        if named:
            return f'There is {_all(named)}, and nothing explains what else differs on {joint}.'
        return f'Neither an effect of the catalogue nor a function explains {joint}.'
    what = term.there.physics.rstrip('.')
    states = ''.join(f' and {factor.there.argument.words}' for factor in term.factors)
    return f'Missing on {term.joint}: {what[0].lower()}{what[1:]}{states}.'


def label(effect: NamedEffect) -> str:
    """The name of an effect, in doubt where a second recording does not confirm it."""
    return f'{effect.id} (in doubt)' if effect.doubtful else effect.id


def _doubt(case: ExplainedCase, effect: NamedEffect) -> str:
    passed = effect.definition.traits.depends_on_time
    stands = 'acted in this one alone, or stands' if passed else 'may stand'
    text = (
        f'{_named(effect)} fits this recording, but does not clearly predict the second one '
        f'better; it {stands} for something else.'
    )
    letter = f'_{axis(effect.joint)}'
    refitted = {s: f for s, f in case.validation.get('refitted', {}).items() if letter in s}
    if not refitted:
        return text
    signal, before = max(refitted.items(), key=lambda item: item[1].ratio)
    after = case.validation['augmented'][signal]
    return (
        f'{text} There {plain(signal)} is off by {digits(after.ratio)} instead of '
        f'{digits(before.ratio)} times its noise.'
    )


def _named(effect: NamedEffect) -> str:
    """An effect, and the names that are confounded with it."""
    left = effect.left_open
    if len(left) > 1:
        return f'{in_words(left)} on {effect.joint}'
    rival = f' or {effect.alternatives[0]}' if effect.alternatives else ''
    return f'{effect.id}{rival} on {effect.joint}'


def _all(names: Sequence[str]) -> str:
    return ' and '.join([', '.join(names[:-1]), names[-1]]) if len(names) > 1 else names[0]


def _capital(text: str) -> str:
    # The name of a signal stays as it is.
    return text if '/' in text.split(maxsplit=1)[0] else text[:1].upper() + text[1:]


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return rows below their heads in columns of even width."""
    lines = [head, *rows]
    widths = [max(len(row[k]) for row in lines) for k in range(len(head))]
    return '\n'.join(
        '  '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in lines
    )


def terminal_text(case: ExplainedCase) -> str:
    """Say what was found, in lines of which the first one is the verdict's sentence."""
    lines = [verdict_sentence(case), *reservations(case)]
    for effect in case.effects:
        text = ' '.join(filter(None, (physics_of(effect), how_sure(effect))))
        lines.append(f'  {label(effect)}: {text}')
        lines += [f'    {one}' for one in numbers_of(effect)]
    if case.rest is Verdict.PARAMETERS_DIFFER:
        for (joint, name), e in differing(case).items():
            lines.append(f'  {joint}: {shown(name, e)}')
    lines += [f'  {one}' for one in not_shown(case)]
    term = case.explanation.unknown
    if term is not None and term.helps:
        lines.append(f'  It explains {100 * term.explained:.0f} % of the excess misfit.')
    lines += [f'Where: {where(place)}.' for place in case.places]
    fits = fits_table(case)
    if fits:
        head, rows = fits
        lines += table(('rmse / noise', *head[1:]), rows).splitlines()
    lines += visited_once(case)
    lines.append(f'Next: {next_step(case)}')
    return '\n'.join(lines)


def fits_table(case: ExplainedCase) -> tuple[tuple[str, ...], list[tuple[str, ...]]] | None:
    """Misfit over noise of each signal by each plant: heads and rows; None where none was made."""
    plants = judged(case, case.ladder)
    if not plants.get('nominal'):
        return None
    rows = [
        (plain(signal), *(digits(fits[signal].ratio) for fits in plants.values()))
        for signal in plants['nominal']
    ]
    return ('signal', *(PLANTS[name] for name in plants)), rows

"""The verdict in one sentence."""

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.case import ExplainedCase, Ladder
from endoscope_explain.combine import changed_parameters
from endoscope_explain.explanation import NamedEffect, Verdict

HEADLINES = {
    Verdict.CONSISTENT: 'Simulation and recording agree',
    Verdict.PARAMETERS_DIFFER: 'Only parameters differ',
    Verdict.MISSING_PHYSICS: 'The simulation leaves out physics',
    Verdict.SENSOR_FAULT: 'A sensor is at fault',
    Verdict.RECORDING_FAULT: 'The recording is at fault',
    Verdict.UNKNOWN_PHYSICS: 'Physics outside the catalogue',
    Verdict.INSUFFICIENT_DATA: 'The recording cannot tell',
}

LEAST_EXPLAINED = 0.05
"""A formula that takes away less of the misfit than this is not offered as what acts."""


def worst_ratio(ladder: Ladder, rung: str) -> float:
    """Return the largest rmse / noise of any signal on a rung."""
    return max(fit.ratio for fit in ladder[rung].values())


def verdict_sentence(case: ExplainedCase) -> str:
    """Say in one sentence what was found and how much better the improved plant predicts."""
    if case.verdict is Verdict.INSUFFICIENT_DATA:
        return 'The rig moves too little, or too little was recorded, to tell causes apart.'
    if case.audit.unusable:
        return ' '.join(f'{f.text}; {f.remedy}.' for f in case.audit.faults())
    before = worst_ratio(case.ladder, 'nominal')
    after = worst_ratio(case.ladder, 'augmented')
    better = (
        f'with that, the worst signal is {_times(after)} its noise on held-out data, '
        f'before {_times(before)}'
    )
    named = '; '.join(_named(effect) for effect in case.effects)
    if case.verdict is Verdict.CONSISTENT:
        return (
            f'Nothing is left out and no parameter is beyond its tolerance: what remains is '
            f'{_times(after)} the noise.'
        )
    if case.verdict is Verdict.PARAMETERS_DIFFER:
        return f'{_differing(case)}; {better}.'
    if case.verdict is Verdict.UNKNOWN_PHYSICS:
        return _unknown(case, better)
    if not case.effects:
        faults = '; '.join(f.text for f in case.audit.faults())
        return f'{faults}.'
    return f'{named}; {better}.'


def _named(effect: NamedEffect) -> str:
    definition = CATALOGUE.get(effect.id)
    physics = definition.physics.rstrip('.') if definition else effect.id.replace('_', ' ')
    return f'{physics} ({effect.id} on {effect.joint}, {100 * effect.probability:.0f} %)'


def _differing(case: ExplainedCase) -> str:
    apart = [
        f'{name} of {joint} is {e.value:.3g} instead of {e.nominal:.3g} {e.unit}'.rstrip(' -')
        for joint, estimates in case.explanation.parameters.items()
        for name, e in changed_parameters(estimates).items()
    ]
    return '; '.join(apart) if apart else 'Parameters differ within their tolerance'


def _unknown(case: ExplainedCase, better: str) -> str:
    term = case.explanation.unknown
    if term is None:
        return f'A significant mismatch remains that no effect of the catalogue explains; {better}.'
    if term.explained < LEAST_EXPLAINED:
        return (
            f'A significant mismatch of {term.joint} remains that neither an effect of the '
            f'catalogue nor a function of one state explains; {better}.'
        )
    what = f'{term.what[0].lower()}{term.what[1:]}'
    siblings = f', nearest to {" and ".join(term.siblings[:2])}' if term.siblings else ''
    return (
        f'No effect of the catalogue explains the mismatch of {term.joint}; {what} accounts for '
        f'{100 * term.explained:.0f} % of it{siblings}; {better}.'
    )


def _times(ratio: float) -> str:
    return f'{ratio:.2f} times' if ratio < 10 else f'{ratio:.0f} times'

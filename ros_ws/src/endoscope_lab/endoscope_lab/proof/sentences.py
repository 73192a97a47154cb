"""Results of the proof in sentences."""

import math
from collections.abc import Sequence
from statistics import median

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.report.numbers import digits
from endoscope_lab.concealed.judge import Statement
from endoscope_lab.concealed.row import GOOD
from endoscope_lab.proof.trial import Outcome


def headline(outcomes: Sequence[Outcome]) -> str:
    right = sum(each.judgement.exact for each in outcomes)
    return f'{right} of {len(outcomes)} right: the injected effect is named, and nothing else'


def summary(outcomes: Sequence[Outcome]) -> str:
    """False names and prediction errors over all rigs."""
    wrong = sum(each.judgement.false for each in outcomes)
    before = median(each.answer.before for each in outcomes)
    after = median(each.answer.after for each in outcomes)
    false = f'{wrong or "No"} false {"name was" if wrong == 1 else "names were"} given'
    return (
        f'{false}. The second recording of each rig is predicted to {digits(before)} times its '
        f'noise with the described plant, and to {digits(after)} times with the improved one '
        f'(medians of the worst signals).'
    )


def injected(outcome: Outcome) -> str:
    laws = [
        f'{law.name} on {law.joint or "all joints"}'
        if law.name in CATALOGUE
        else f'a law outside the catalogue: {_lower(FUNCTIONS[law.name].physics)}, on {law.joint}'
        for law in outcome.rig.laws
    ]
    words = outcome.truth.get('words')
    return (' and '.join(laws) or 'nothing') + (f' ({words})' if words else '')


def reported(statements: Sequence[Statement]) -> str:
    """The reported names, the most certain first."""
    names = [f'{s.name} on {s.joint}' + _alternatives(s) for s in statements]
    return ', '.join(names) or 'nothing'


def result(outcome: Outcome) -> str:
    """The judgement in a few words."""
    how = outcome.judgement
    if how.exact:
        return 'right'
    if not outcome.rig.laws:
        return 'wrong: nothing was injected'
    if how.first:
        return 'right, with further names'
    if how.in_set:
        return 'among the alternatives that these motions do not distinguish'
    if how.place:
        return 'the right place, another name'
    if how.stage:
        return 'the right stage of the chain, another law'
    return 'missed' if not outcome.answer.reported else 'wrong'


def tracking(outcome: Outcome) -> str:
    """Tracking error of the slave with either plant; empty for a rig that does not run."""
    if not outcome.tracking:
        return ''
    before, after = (math.degrees(outcome.tracking[name].rmse) for name in ('nominal', 'augmented'))
    return (
        f'the tip is off by {before:.2f} deg rms under the inverse of the described plant, by '
        f'{after:.2f} deg under that of the improved one'
    )


def why(outcome: Outcome) -> str:
    """Why the answer is not right, by the second recording; empty if it is right."""
    if outcome.judgement.exact:
        return ''
    answer = outcome.answer
    if not answer.reported:
        return (
            f'The law moves {100.0 * outcome.rig.moved:.0f} % of the signal that shows it most. '
            f'Refitted parameters absorb it: they predict the second recording to '
            f'{digits(answer.refitted)} times its noise.'
        )
    if answer.after <= GOOD:
        return (
            'The name given instead predicts the second recording to '
            f'{digits(answer.after)} times its noise: these motions do not distinguish it.'
        )
    return f'The name given leaves {digits(answer.after)} times the noise: the law is not found.'


def _alternatives(statement: Statement) -> str:
    return f' (or {", ".join(statement.alternatives)})' if statement.alternatives else ''


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:].rstrip('.')

"""What came out of the proof, in sentences."""

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
    return f'{right} of {len(outcomes)} right: what was concealed is named, and nothing else'


def summary(outcomes: Sequence[Outcome]) -> str:
    """What else came out, over all rigs."""
    wrong = sum(each.judgement.false for each in outcomes)
    before = median(each.answer.before for each in outcomes)
    after = median(each.answer.after for each in outcomes)
    named = f'{wrong} {"name was" if wrong == 1 else "names were"} given that nothing stands for'
    return (
        f'{named if wrong else "No name was given that nothing stands for"}. A second recording of '
        f'each rig is off by {digits(before)} times its noise with the described plant, by '
        f'{digits(after)} times with the improved one (medians of the worst signals).'
    )


def concealed(outcome: Outcome) -> str:
    laws = [
        f'{law.name} on {law.joint or "all joints"}'
        if law.name in CATALOGUE
        else f'a law that no catalogue has: {_lower(FUNCTIONS[law.name].physics)}, on {law.joint}'
        for law in outcome.rig.laws
    ]
    words = outcome.truth.get('words')
    return (' and '.join(laws) or 'nothing') + (f' ({words})' if words else '')


def reported(statements: Sequence[Statement]) -> str:
    """The reported names, the most certain first."""
    names = [f'{s.name} on {s.joint}' + _alternatives(s) for s in statements]
    return ', '.join(names) or 'nothing'


def result(outcome: Outcome) -> str:
    """Whether it is right, in few words."""
    how = outcome.judgement
    if how.exact:
        return 'right'
    if not outcome.rig.laws:
        return 'wrong: nothing was concealed'
    if how.first:
        return 'right, and more is named beside it'
    if how.in_set:
        return 'among the alternatives that these motions do not distinguish'
    if how.place:
        return 'the right place by another name'
    if how.stage:
        return 'the right part of the chain, another law'
    return 'missed' if not outcome.answer.reported else 'wrong'


def tracking(outcome: Outcome) -> str:
    """How well the slave follows by either plant; empty of a rig that does not run."""
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
            f'Other numbers hide it: they predict the second recording to '
            f'{digits(answer.refitted)} times its noise.'
        )
    if answer.after <= GOOD:
        return (
            'What is named instead predicts the second recording to '
            f'{digits(answer.after)} times its noise: these motions do not distinguish it.'
        )
    return f'What is named leaves {digits(answer.after)} times the noise: the law is not found.'


def _alternatives(statement: Statement) -> str:
    return f' (or {", ".join(statement.alternatives)})' if statement.alternatives else ''


def _lower(text: str) -> str:
    return text[:1].lower() + text[1:].rstrip('.')

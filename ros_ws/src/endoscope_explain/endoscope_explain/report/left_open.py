"""What a recording leaves open, in words: names, and what was moved once only, unchecked."""

import math
from collections.abc import Iterable, Sequence

from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.case import ExplainedCase
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.observe.observation import commanded
from endoscope_explain.observe.revisits import Stroke, strokes
from endoscope_explain.prediction_set import Posterior
from endoscope_explain.report.numbers import moving_joints


def in_words(left: Posterior) -> str:
    """Names of a set with their probabilities, the likeliest first; empty where there are none."""
    return _any(_statement(names, p) for names, p in left.items()) if left else ''


def _statement(names: Sequence[str], probability: float) -> str:
    """Names that are one statement in a recording, and how likely that is."""
    first, *same = names
    notes = [function_of(first)] if first in FUNCTIONS else []
    notes += [f'here the same as {" and ".join(same)}'] if same else []
    return f'{first} ({", ".join([*notes, f"{probability:.2f}"])})'


def function_of(place: str) -> str:
    """What a function at a place is one of."""
    return f'a function of {FUNCTIONS[place].argument.words}'


def what_is_open(effect: NamedEffect) -> str:
    """The names that a recording leaves open for one effect."""
    left = effect.left_open
    if len(left) > 1:
        return f'The recording leaves open: {in_words(left)}.'
    if effect.alternatives:
        return f'The data cannot distinguish it from {_any(effect.alternatives)}.'
    return 'No alternative fits as well.'


def _any(names: Iterable[str]) -> str:
    *most, last = names
    return f'{", ".join(most)} or {last}' if most else last


WIDE = 0.65
"""Share of a joint's range from which on a stroke is wide. The first one, from rest in the middle,
is none: its branch is that of a rig that has not moved yet, and never comes again."""
FEW = 0.25
"""Share of the wide strokes below which a motion is asked for, in place of naming them."""
MOST_NAMED = 2
MOTION = (
    'Record a stroke 40 deg wider than the backlash, there and back twice, '
    'one small reversal loop, and a hold of 5 s.'
)
"""Without the hold, friction and viscoelasticity are one thing at one speed."""


def visited_once(case: ExplainedCase) -> list[str]:
    """Say of each joint which wide strokes were made once only; nothing of one without any."""
    recording = case.recording
    if not case.explanation.fit:
        return []
    desired = commanded(recording) / recording.gear
    moving = moving_joints(recording)
    sentences = [
        once_only(joint, strokes(desired[:, j]))
        for j, joint in enumerate(recording.joints)
        if joint in moving
    ]
    return [text for text in sentences if text]


def once_only(joint: str, made: Sequence[Stroke]) -> str:
    """Say which of a joint's wide strokes were made once only; empty where none was."""
    ends = [angle for stroke in made for angle in (stroke.start, stroke.end)]
    least = WIDE * (max(ends, default=0.0) - min(ends, default=0.0))
    wide = [stroke for stroke in made if abs(stroke.end - stroke.start) >= least]
    once = [stroke for stroke in wide if not stroke.twice]
    if not once:
        return ''
    twice = len(wide) - len(once)
    if twice < FEW * len(wide):
        few = f'only {twice} of {len(wide)} wide strokes' if twice else 'no wide stroke'
        return (
            f'{joint}: {few} {_were(twice)} made twice. What depends on the bend was fitted, but '
            f'could hardly be checked. {MOTION}'
        )
    named = [_named(stroke) for stroke in once[:MOST_NAMED]]
    more = len(once) - len(named)
    rest = f' ({more} more)' if more else ''
    return (
        f'{joint}: {twice} of {len(wide)} wide strokes {_were(twice)} made twice; made once only: '
        f'{", ".join(named)}{rest}. What depends on the bend there was fitted, but could not be '
        'checked.'
    )


def _were(count: int) -> str:
    return 'were' if count > 1 else 'was'


def _named(stroke: Stroke) -> str:
    start, end = (round(math.degrees(angle)) for angle in (stroke.start, stroke.end))
    return f'the {"rise" if end > start else "fall"} from {start} to {end} deg'

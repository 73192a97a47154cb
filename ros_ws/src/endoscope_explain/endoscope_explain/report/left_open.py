"""What a recording leaves open, in words."""

from collections.abc import Iterable, Sequence

from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.explanation import NamedEffect
from endoscope_explain.prediction_set import Posterior


def in_words(left: Posterior) -> str:
    """Names of a set with their probabilities, the likeliest first."""
    return _any(_statement(names, p) for names, p in left.items())


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

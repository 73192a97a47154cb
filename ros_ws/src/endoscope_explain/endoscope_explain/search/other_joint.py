"""Whether a search ends as it did once the other joint is known to move in another way.

Few terms depend on what the other joint does. Without one of them among what was found, all else
that was fitted stands as it is, and only these have to be looked at again.
"""

from dataclasses import replace

import numpy as np

from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import OTHER_ANGLE
from endoscope_explain.recording import Array
from endoscope_explain.search.expansion import addable
from endoscope_explain.search.levels import JointSearch, Level
from endoscope_explain.search.null_rigs import NEAR
from endoscope_explain.search.screen import background, directions, gains
from endoscope_explain.search.term import Term

_PLACES = frozenset(place.id for place in FUNCTIONS.values() if place.argument is OTHER_ANGLE)


def depends_on_other(term: Term) -> bool:
    """Whether a term depends on the other joint's angle."""
    return term.id in _PLACES or bool(_PLACES & set(term.effect.traits.families))


def stands_beside(tried: JointSearch, angle: Array, left_out: tuple[str, ...], jobs: int) -> bool:
    """Whether a search would find the same beside the other joint's angle (N,) in rad."""
    found = [tried.found, *(level.best for level in tried.levels if level.found)]
    if any(depends_on_other(term) for one in found for term in one.terms):
        return False
    return all(_gain_beside(level, angle, left_out, jobs) < _least(level) for level in tried.levels)


def _least(level: Level) -> float:
    """Gain by the screen from which on a term might be found in place of the level's best."""
    # A fit may double what the screen shows of it.
    return NEAR * max(level.gain(level.best), 0.0) if level.found else 0.0


def _gain_beside(level: Level, angle: Array, left_out: tuple[str, ...], jobs: int) -> float:
    """Largest gain by the screen of what depends on the other joint."""
    parent = level.parent.fit
    observation = parent.model.observation.beside(angle)
    behind = background(replace(parent, model=replace(parent.model, observation=observation)))
    terms = [term for term in addable(behind, left_out) if depends_on_other(term)]
    ways = directions(behind, tuple(terms), jobs)
    residuals = behind.left(parent.residuals * behind.weight)[:, None]
    return float(np.max(gains(behind, ways, residuals).values, initial=0.0))

"""The functions of all places of a hook, added up and multiplied by one compiled function.

A call for each place would more than double the time to compile the plant, since numba works anew
on all that a function calls. So the places of a hook that act alike stand in a row, and the fold
hands over their arguments.
"""

from itertools import groupby

import numpy as np

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.acting import MULTIPLIES
from endoscope_core.physics.functions.interpolation import function_at
from endoscope_core.physics.functions.place import Place, Shape
from endoscope_core.physics.hooks import HOOKS

MOST = 7
"""Places that can stand in a row."""


def _alike(place: Place) -> tuple[int, str, str, str]:
    names = [hook.name for hook in HOOKS]
    return names.index(place.hook.name), place.only, place.sign, place.by_step


def _partner(place: Place) -> tuple[float, float]:
    """Share and side of `function_at`."""
    mirrored = {Shape.ODD: (-0.5, -1.0), Shape.EVEN: (0.5, -1.0)}
    return mirrored.get(place.shape, (-1.0, 0.0) if place.from_zero else (0.0, 1.0))


Row = tuple[int, tuple[Place, ...]]
"""Number of the first of the places that stand in a row, and those places."""
_ROW = sorted(FUNCTIONS.values(), key=_alike)
ROWS: tuple[Row, ...] = tuple(
    (_ROW.index(places[0]), places)
    for places in (tuple(each) for _, each in groupby(_ROW, key=_alike))
)
"""By their hooks."""
_FLAGS = np.array([place.flag for place in _ROW])
_FIRST = np.array([place.first_parameter for place in _ROW])
_SHARE, _SIDE = np.array([_partner(place) for place in _ROW]).T.copy()
_REPEATS = np.array([place.shape is Shape.PERIODIC for place in _ROW])


@compiled
def sum_of_functions(
    on: Flags,
    p: Array,
    number: float,
    count: float,
    a0: float,
    a1: float,
    a2: float,
    a3: float,
    a4: float,
    a5: float,
    a6: float,
) -> tuple[float, float, float, float]:
    """Functions of `count` places from `number` of their row on, with the arguments `a0` to `a6`.

    Sum of the terms and its slope; product of one plus each that multiplies, and its slope.
    """
    value, slope, factor, steep = 0.0, 0.0, 1.0, 0.0
    # Both are whole, but numba would compile this anew for every integer that stands in a call.
    for k in range(int(number), int(number + count)):
        if on[_FLAGS[k]]:
            found, rise = function_at(p, _FIRST[k], a0, _SHARE[k], _SIDE[k], _REPEATS[k])
            if on[_FLAGS[k]] == MULTIPLIES:
                steep = steep * (1.0 + found) + factor * rise
                factor *= 1.0 + found
            else:
                value += found
                slope += rise
        a0, a1, a2, a3, a4, a5 = a1, a2, a3, a4, a5, a6
    return value, slope, factor, steep

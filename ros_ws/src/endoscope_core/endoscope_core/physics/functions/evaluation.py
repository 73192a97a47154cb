"""Functions of one state in the compiled physics: one function's value, and the sum of many.

A function goes through its values at equally spaced nodes as a cubic whose slope at a node is that
of the parabola through it and its neighbours (Catmull, Rom, in Computer Aided Geometric Design,
1974): parabolas are exact, and a value acts on two cells either way. Beyond its range it keeps its
last value, or begins again.
"""

import math
from itertools import groupby
from typing import Any

import numpy as np
from numba import types
from numba.extending import overload
from numpy.typing import NDArray

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics.functions.places import (
    FUNCTIONS,
    HIGH,
    LOW,
    NODES,
    VALUES,
    Place,
    Shape,
)
from endoscope_core.physics.hooks import HOOKS

FLAGS_OF_FUNCTIONS = np.int8
"""Kind of the flags of a plant with functions."""
ADDS, MULTIPLIES = 1, 2
"""Flags of a function that is a term of its own, and of one that multiplies the others."""


def functions_act(on: NDArray[Any]) -> bool:
    """Whether a plant with these flags has functions; a constant in compiled code."""
    # Tests of the functions' flags, or of one flag for all, cost the plant that has none of them a
    # tenth of its speed, since compiled code is laid out for both cases. So the flags of a plant
    # with functions are bytes instead of truth values: numba compiles it apart from the one
    # without, at its first use, and the one without holds nothing of them.
    return on.dtype == FLAGS_OF_FUNCTIONS


@overload(functions_act)
def _functions_act(on: Any) -> Any:
    def yes(on: Any) -> bool:
        return True

    def no(on: Any) -> bool:
        return False

    return yes if on.dtype == types.int8 else no


@compiled
def function_at(
    p: Array, first: int, argument: float, share: float, side: float, repeats: bool
) -> tuple[float, float]:
    """Value and slope of the function whose block begins at `first`.

    ``share f(side argument)`` is added to ``(1 - abs(share)) f(argument)``: the odd part with -0.5
    and -1, the even one with 0.5 and -1; what is left of the value at zero with -1 and 0, where f
    itself counts whole. If it `repeats`, its range is a period.
    """
    low = p[first + LOW]
    per_unit = (NODES - 1) / (p[first + HIGH] - low)
    node = first + VALUES
    value, slope = 0.0, 0.0
    weight, sign = 1.0 if side == 0.0 else 1.0 - abs(share), 1.0
    for _ in range(1 if share == 0.0 else 2):
        place = (sign * argument - low) * per_unit
        if repeats:
            place -= (NODES - 1) * math.floor(place / (NODES - 1))
        inside = 0.0 < place < NODES - 1
        if not inside:
            # Not a number takes the first value: as an index it would reach anywhere.
            place = NODES - 1.0 if place > 0.0 else 0.0
        i = min(int(place), NODES - 2)
        here, after = p[node + i], p[node + i + 1]
        if repeats:
            # The last value is the first of the next period.
            after = p[node + (i + 1) % (NODES - 1)]
            before = p[node + (i - 1) % (NODES - 1)]
            beyond = p[node + (i + 2) % (NODES - 1)]
        else:
            before = p[node + i - 1] if i > 0 else 3.0 * (here - after) + p[node + 2]
            beyond = p[node + i + 2] if i < NODES - 2 else 3.0 * (after - here) + p[node + i - 1]
        t = place - i
        c1 = after - before
        c2 = 2.0 * before - 5.0 * here + 4.0 * after - beyond
        c3 = 3.0 * (here - after) + beyond - before
        value += weight * (here + 0.5 * t * (c1 + t * (c2 + t * c3)))
        if inside or repeats:
            slope += weight * sign * 0.5 * (c1 + t * (2.0 * c2 + t * 3.0 * c3)) * per_unit
        weight, sign = share, side
    return value, slope


MOST = 7
"""Places that can stand in a row."""


def _alike(place: Place) -> tuple[int, int, str, str]:
    names = [hook.name for hook in HOOKS]
    cell = -1 if place.cell is None else place.cell
    sign, by_step = ('' if f is None else f.__name__ for f in (place.sign, place.by_step))
    return names.index(place.hook.name), cell, sign, by_step


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
    # A call for each place would more than double the time to compile the plant, since numba works
    # again on all that a function calls. So the places of a hook that act alike stand in a row, and
    # the fold hands over their arguments.
    value, slope, factor, steep = 0.0, 0.0, 1.0, 0.0
    # Both are whole, but numba would compile this again for every integer that stands in a call.
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

"""A smooth function of one argument in the compiled physics, from numbers of the parameter array.

It goes through its values at equally spaced nodes as a cubic whose slope at a node is that of the
parabola through it and its neighbours (Catmull, Rom, in Computer Aided Geometric Design, 1974):
parabolas are exact, and a value acts on two cells either way. Beyond its range it keeps its last
value, or begins again.
"""

import math

from endoscope_core.compiled import Array, compiled

NODES = 41
"""Values of a function: a triangle wave of one period over its range, the worst of the common laws,
is then off by less than 2 % of what it spans wherever its corners lie (a test measures it)."""
LOW, HIGH, VALUES = 0, 1, 2
"""Places of the range's ends and of the first value within the function's block of parameters."""
LAG = VALUES + NODES
"""Place of the time constant of an argument that lags."""


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
    weight, way = 1.0 if side == 0.0 else 1.0 - abs(share), 1.0
    for _ in range(1 if share == 0.0 else 2):
        place = (way * argument - low) * per_unit
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
            slope += weight * way * 0.5 * (c1 + t * (2.0 * c2 + t * 3.0 * c3)) * per_unit
        weight, way = share, side
    return value, slope

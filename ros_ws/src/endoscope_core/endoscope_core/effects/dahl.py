"""Dahl's pre-sliding friction state, advanced exactly over a displacement."""

import math

from endoscope_core.compiled import compiled


@compiled
def path_length(way: float, shake: float) -> float:
    """Length of a way that goes to and fro by `shake` while it makes headway `way`."""
    return abs(way) if shake == 0.0 else math.hypot(way, shake)


@compiled
def slid(slide: float, ratio: float, shake: float) -> float:
    """Dahl state after sliding `ratio` pre-sliding distances (signed); stays in [-1, 1].

    Solves ``z' = v - s z`` with the path's speed ``s``, which is ``|v|`` without `shake`, the
    pre-sliding distances shaken to and fro meanwhile.
    """
    path = path_length(ratio, shake)
    if path == 0.0:
        return slide
    share = 1.0 - math.exp(-path) if path > 0.02 else path * (1.0 - path * (0.5 - path / 6.0))
    return slide + share * (ratio / path - slide)

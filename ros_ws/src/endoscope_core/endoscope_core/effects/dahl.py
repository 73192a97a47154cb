"""Dahl's pre-sliding friction state, advanced exactly over a displacement."""

import math

from endoscope_core.compiled import compiled


@compiled
def slid(slide: float, ratio: float) -> float:
    """Dahl state after sliding `ratio` pre-sliding distances (signed); stays in [-1, 1]."""
    size = abs(ratio)
    share = 1.0 - math.exp(-size) if size > 0.02 else size * (1.0 - size * (0.5 - size / 6.0))
    return slide + share * ((1.0 if ratio > 0.0 else -1.0) - slide)

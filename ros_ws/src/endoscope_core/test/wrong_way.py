"""How far a tip goes against its motor."""

import numpy as np


def wrong_way_motion(motor, tip):
    """Furthest that a tip (N,) goes back while its motor (N,) goes on one way."""
    drive, angle = np.asarray(motor, dtype=float), np.asarray(tip, dtype=float)
    way = np.sign(np.diff(drive))
    turns = np.flatnonzero(way[1:] != way[:-1]) + 1
    furthest = 0.0
    for first, last in zip([0, *turns], [*turns, len(way)], strict=True):
        along = way[first] * angle[first : last + 1]
        furthest = max(furthest, float(np.max(np.maximum.accumulate(along) - along)))
    return furthest

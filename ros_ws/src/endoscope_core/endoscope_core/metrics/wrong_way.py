"""Motion of a tip against the motor that drives it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def wrong_way_motion(motor: ArrayLike, tip: ArrayLike) -> float:
    """Furthest that a tip goes back while its motor goes on one way.

    Parameters
    ----------
    motor, tip : array_like, shape (N,)
        Angles at the same instants; a positive motor angle bends the tip to the positive side.

    Returns
    -------
    float
        In the unit of `tip`, zero or more.
    """
    drive, angle = np.asarray(motor, dtype=float), np.asarray(tip, dtype=float)
    way = np.sign(np.diff(drive))
    turns = np.flatnonzero(way[1:] != way[:-1]) + 1
    furthest = 0.0
    for first, last in zip([0, *turns], [*turns, len(way)], strict=True):
        along = way[first] * angle[first : last + 1]
        furthest = max(furthest, float(np.max(np.maximum.accumulate(along) - along)))
    return furthest

"""How far the actual angle is from the desired one, and how far a tip goes against its motor."""

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


def tracking_rmse(desired: ArrayLike, actual: ArrayLike) -> float:
    """Root of the mean square of ``actual - desired`` over all samples, in the unit of the input.

    Parameters
    ----------
    desired, actual : array_like, same shape
        Angles at the same instants.

    Raises
    ------
    ValueError
        If the shapes differ, there are no samples, or a value is not finite.
    """
    error = _same_shape(actual, desired, 'actual', 'desired')
    return float(np.sqrt(np.mean(error**2)))


def _same_shape(
    first: ArrayLike, second: ArrayLike, first_name: str, second_name: str
) -> np.ndarray:
    a = np.asarray(first, dtype=float)
    b = np.asarray(second, dtype=float)
    if a.shape != b.shape:
        raise ValueError(
            f'{first_name} has shape {a.shape}, {second_name} has shape {b.shape}: '
            'they must be equal'
        )
    if a.size == 0:
        raise ValueError(f'{first_name} and {second_name} hold no samples')
    difference = a - b
    if not np.all(np.isfinite(difference)):
        raise ValueError(f'{first_name} or {second_name} holds values that are not finite')
    return difference

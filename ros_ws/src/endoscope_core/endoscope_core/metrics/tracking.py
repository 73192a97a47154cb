"""How far the actual angle is from the desired one."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


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

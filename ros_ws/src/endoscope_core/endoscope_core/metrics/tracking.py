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
    a, d = np.asarray(actual, dtype=float), np.asarray(desired, dtype=float)
    if a.shape != d.shape:
        raise ValueError(
            f'actual has shape {a.shape}, desired has shape {d.shape}: they must be equal'
        )
    if a.size == 0:
        raise ValueError('actual and desired hold no samples')
    error = a - d
    if not np.all(np.isfinite(error)):
        raise ValueError('actual or desired holds values that are not finite')
    return float(np.sqrt(np.mean(error**2)))

"""Figures of merit: the size of a backlash, and how far a joint is from the desired angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.errors import EndoscopeError

__all__ = ['NoLoopError', 'tracking_rmse', 'width_at_mid_height']


class NoLoopError(EndoscopeError, ValueError):
    """The actual angle does not pass its middle both upwards and downwards."""


def width_at_mid_height(desired: ArrayLike, actual: ArrayLike) -> float:
    """Width of the hysteresis loop at the middle of its height, in the unit of `desired`.

    That is the mean desired angle at which the actual one rises through the level, less that at
    which it falls: positive where it lags. Both (N,), in time order, over a whole loop or more.
    NoLoopError if there is none, ValueError for wrong shapes or what is not finite.
    """
    u = np.asarray(desired, dtype=float)
    q = np.asarray(actual, dtype=float)
    if u.ndim != 1 or u.shape != q.shape:
        raise ValueError(
            f'desired {u.shape} and actual {q.shape} must be one-dimensional and equally long'
        )
    if not (np.all(np.isfinite(u)) and np.all(np.isfinite(q))):
        raise ValueError('desired or actual holds values that are not finite')
    if u.size < 3 or np.ptp(q) == 0.0:
        raise NoLoopError('the actual angle does not move: there is no loop to measure')
    height = np.ptp(q)
    offset = q - 0.5 * (np.max(q) + np.min(q))
    band = 0.1 * height
    if abs(u[-1] - u[0]) <= 0.1 * np.ptp(u) and abs(offset[-1] - offset[0]) <= band:
        # A closed loop may begin anywhere, even on its way through the middle.
        turn = -int(np.argmax(np.abs(offset)))
        u, offset = np.roll(u, turn), np.roll(offset, turn)
    rising, falling = _crossings(u, offset, band)
    if rising.size == 0 or falling.size == 0:
        raise NoLoopError(
            'the recording holds no whole loop: the actual angle passes its middle one way only'
        )
    return float(np.mean(rising) - np.mean(falling))


def _crossings(
    u: NDArray[np.float64],
    offset: NDArray[np.float64],
    band: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Values of u where offset passes zero between beyond -band and beyond +band, and back."""
    outside = np.flatnonzero(np.abs(offset) > band)
    side = np.sign(offset[outside])
    turns = np.flatnonzero(side[1:] != side[:-1])
    rising: list[float] = []
    falling: list[float] = []
    for k in turns:
        first, last = outside[k], outside[k + 1]
        piece = offset[first : last + 1]
        through = (np.sign(piece[1:]) * np.sign(piece[:-1]) <= 0.0) & (piece[1:] != piece[:-1])
        passes = first + np.flatnonzero(through)
        weight = offset[passes] / (offset[passes] - offset[passes + 1])
        where = float(np.mean(u[passes] + weight * (u[passes + 1] - u[passes])))
        (rising if side[k] < 0 else falling).append(where)
    return np.array(rising), np.array(falling)


def tracking_rmse(desired: ArrayLike, actual: ArrayLike) -> float:
    """Root of the mean square of ``actual - desired`` over all samples, in the unit of the input.

    ValueError if the shapes differ, there are no samples, or a value is not finite.
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

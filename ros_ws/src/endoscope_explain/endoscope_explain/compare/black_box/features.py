"""What a black box knows of the motion: the commands' angle, speed and history."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]

GRID_S = 0.01
PLAY_WIDTHS = (0.1, 0.3, 0.6, 1.0)
"""Full widths in rad of play operators, the memory of hysteresis."""
LAGS_S = (0.05, 0.3, 2.0)
"""Time constants of low passes, the memory of rates."""


def motion_features(time: Array, angle: Array, at: Array) -> Array:
    """Describe the motion at some instants by commands alone.

    `time` (N,): stamps of the commands in s.
    `angle` (N, J): commands in rad, joint-equivalent, the joint of interest first.
    `at` (M,): in s.
    Returns (M, J * 9): for each joint: angle, speed, plays of the angle, lagging angles.
    """
    grid = np.arange(min(time[0], at.min()), max(time[-1], at.max()) + GRID_S, GRID_S)
    columns = []
    for j in range(angle.shape[1]):
        u = np.interp(grid, time, angle[:, j])
        columns += [u, np.gradient(u, GRID_S), *_plays(u).T, *(_lagging(u, lag) for lag in LAGS_S)]
    return np.stack([np.interp(at, grid, c) for c in columns], axis=1)


def _plays(u: Array) -> Array:
    half = 0.5 * np.array(PLAY_WIDTHS)
    out = np.empty((len(u), len(half)))
    position = np.full(len(half), u[0])
    for i, value in enumerate(u):
        position = np.clip(position, value - half, value + half)
        out[i] = position
    return out


def _lagging(u: Array, lag: float) -> Array:
    share = 1.0 - np.exp(-GRID_S / lag)
    filtered, _ = lfilter([share], [1.0, share - 1.0], u, zi=[(1.0 - share) * u[0]])
    return np.asarray(filtered)

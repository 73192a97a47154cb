"""Compiled plays side by side."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled_cache import njit


@njit(cache=True)
def play_stack_step(
    thresholds: NDArray[np.float64], plays: NDArray[np.float64], driver: float
) -> NDArray[np.float64]:
    """Outputs (M,) of plays of the given thresholds (M,) after a monotone move to `driver`."""
    return np.minimum(driver + thresholds, np.maximum(driver - thresholds, plays))


@njit(cache=True)
def play_stack_path(
    thresholds: NDArray[np.float64], driver: NDArray[np.float64], start: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Outputs (N, M) along a driving angle (N,), from `start` (M,)."""
    states = np.empty((driver.size, thresholds.size))
    plays = start
    for k in range(driver.size):
        plays = play_stack_step(thresholds, plays, driver[k])
        states[k] = plays
    return states

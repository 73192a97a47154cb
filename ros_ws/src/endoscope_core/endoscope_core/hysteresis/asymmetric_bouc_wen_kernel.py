"""Compiled path of a Bouc-Wen state whose shape depends on the direction."""

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled_cache import njit
from endoscope_core.hysteresis.bouc_wen_kernel import bouc_wen_normalised_step


@njit(cache=True)
def asymmetric_path(
    driver: NDArray[np.float64],
    y0: float,
    up: tuple[float, float, float],
    down: tuple[float, float, float],
) -> NDArray[np.float64]:
    """States along a driving angle (N,) in rad; `up` and `down` hold travel, rho and n."""
    states = np.empty(driver.size)
    y = y0
    previous = driver[0]
    for k in range(driver.size):
        delta = driver[k] - previous
        travel, rho, n = up if delta >= 0.0 else down
        y = bouc_wen_normalised_step(y, delta, travel, rho, n)
        previous = driver[k]
        states[k] = y
    return states

"""Compiled exact steps of the Dahl equation with a shape exponent.

With `y` in [-1, 1], ``g = y sgn(theta')`` and `x` the distance travelled in the present direction
in units of the travel, the modified Dahl model (Dahl 1968; second paper, section 2.3, whose printed
equations take the exponent to be one in the loading branch) reads ``dg/dx = (1 - g)**i``. It is
autonomous and has, for ``w = 1 - g``, the closed solution

    i = 1:  w = w0 exp(-x)
    else:   w = (w0**(1-i) + (i-1) x)**(1/(1-i)), and 0 once the bracket is negative (i < 1).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled_cache import njit


@njit(cache=True)
def dahl_step(y: float, delta: float, travel: float, exponent: float) -> float:
    """State in [-1, 1] after the driving angle has moved by `delta` rad, one way, exactly.

    It builds up over `travel` rad: with an `exponent` in (0, 1) it saturates after a finite
    distance, above 1 slowly.
    """
    if delta == 0.0:
        return y
    side = 1.0 if delta > 0.0 else -1.0
    gap = 1.0 - side * y
    if gap <= 0.0:
        return side
    x = abs(delta) / travel
    power = 1.0 - exponent
    if abs(power) < 1e-9:
        return side * (1.0 - gap * math.exp(-x))
    inner = gap**power - power * x
    if inner <= 0.0:
        return side
    left = inner ** (1.0 / power)
    # Rounding of the power must not turn the state back.
    return side * (1.0 - min(left, gap))


@njit(cache=True)
def dahl_path(
    driver: NDArray[np.float64], y0: float, travel: float, exponent: float
) -> NDArray[np.float64]:
    """States along a driving angle (N,) in rad, `y0` at the first sample."""
    states = np.empty(driver.size)
    y = y0
    previous = driver[0]
    for k in range(driver.size):
        y = dahl_step(y, driver[k] - previous, travel, exponent)
        previous = driver[k]
        states[k] = y
    return states


@njit(cache=True)
def play_step(y: float, delta: float, travel: float) -> float:
    """State in [-1, 1] of a play of half-gap `travel` rad, exactly, for any step `delta` rad."""
    return min(1.0, max(-1.0, y + delta / travel))


@njit(cache=True)
def play_path(driver: NDArray[np.float64], y0: float, travel: float) -> NDArray[np.float64]:
    """States along a driving angle (N,) in rad, `y0` at the first sample."""
    states = np.empty(driver.size)
    y = y0
    previous = driver[0]
    for k in range(driver.size):
        y = play_step(y, driver[k] - previous, travel)
        previous = driver[k]
        states[k] = y
    return states

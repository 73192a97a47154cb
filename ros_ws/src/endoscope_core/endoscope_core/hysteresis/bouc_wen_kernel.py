"""Compiled steps of the Bouc-Wen equation in its normalised form.

With ``y = h / h_max``, ``h_max = (A / (B + C))**(1/n)``, ``rho = (B - C) / (B + C)``, and ``x`` the
distance travelled in the present direction in units of ``h_max / A``, equation 4 of the first paper
becomes, for ``g = y sgn(theta')``,

    dg/dx = 1 - g**n            for g >= 0
    dg/dx = 1 + rho |g|**n      for g < 0

an autonomous equation without time: only the travel of the angle counts, not its speed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled_cache import njit

_LONGEST_SUBSTEP = 0.1
_MOST_SUBSTEPS = 64


@njit(cache=True)
def _approach_rate(g: float, rho: float, n: float) -> float:
    """kappa(g) > 0 such that dg/dx = kappa(g) (1 - g)."""
    gap = 1.0 - g
    if g <= 0.0:
        return (1.0 + rho * (-g) ** n) / gap
    if gap < 1e-9:
        return n
    return -math.expm1(n * math.log(g)) / gap


@njit(cache=True)
def _exact_linear(g: float, rho: float, distance: float) -> float:
    """The case n = 1, in which both pieces of the equation integrate to exponentials."""
    if g < 0.0:
        to_zero = math.log1p(-rho * g) / rho if abs(rho) > 1e-12 else -g
        if distance < to_zero:
            grown = -math.expm1(-rho * distance) / rho if abs(rho) > 1e-12 else distance
            return g + (1.0 - rho * g) * grown
        distance -= to_zero
        g = 0.0
    return 1.0 - (1.0 - g) * math.exp(-distance)


@njit(cache=True)
def bouc_wen_normalised_step(y: float, delta: float, travel: float, rho: float, n: float) -> float:
    """Normalised state in [-1, 1] after the driving angle has moved by `delta` rad, one way.

    `travel` is ``h_max / A`` in rad, over which the state builds up; `rho` is in (-1, 1], the
    sharpness `n` at least 1. Every substep has the form ``1 - g_new = (1 - g) exp(-kappa dx)`` with
    ``kappa > 0`` taken at the middle of the substep, which is a convex combination of `g` and 1.
    Hence ``g <= g_new <= 1`` for any step: the state stays in [-1, 1], whatever the sampling.
    """
    if delta == 0.0:
        return y
    side = 1.0 if delta > 0.0 else -1.0
    g = side * y
    distance = abs(delta) / travel
    if n == 1.0:  # the step is exact
        return side * min(1.0, _exact_linear(g, rho, distance))
    substeps = min(_MOST_SUBSTEPS, max(1, math.ceil(min(distance, 1e6) / _LONGEST_SUBSTEP)))
    dx = distance / substeps
    for _ in range(substeps):
        half = 1.0 - (1.0 - g) * math.exp(-0.5 * dx * _approach_rate(g, rho, n))
        g = 1.0 - (1.0 - g) * math.exp(-dx * _approach_rate(half, rho, n))
    return side * g


@njit(cache=True)
def bouc_wen_normalised_path(
    driver: NDArray[np.float64],
    y0: float,
    travel: float,
    rho: float,
    n: float,
) -> NDArray[np.float64]:
    """Normalised state along a recorded driving angle (N,), `y0` at the first sample."""
    states = np.empty(driver.size)
    y = y0
    previous = driver[0]
    for k in range(driver.size):
        y = bouc_wen_normalised_step(y, driver[k] - previous, travel, rho, n)
        previous = driver[k]
        states[k] = y
    return states

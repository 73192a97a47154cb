"""Dahl hysteresis and its direct inverse (section 2.3 of the second paper)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled import njit
from endoscope_core.hysteresis.memory_model import (
    GREATEST_OFFSET,
    NamedNumbers,
    check_inverse,
    check_numbers,
    check_range,
)

LEAST_EXPONENT = 0.5
GREATEST_EXPONENT = 4.0


@njit(cache=True)
def dahl_step(y: float, delta: float, travel: float, exponent: float) -> float:
    """State in [-1, 1] after the driving angle has moved by `delta` rad, one way, exactly.

    It builds up over `travel` rad: with an `exponent` in (0, 1) it saturates after a finite
    distance, above 1 slowly.
    """
    # With ``g = y sgn(theta')`` and `x` the distance travelled in the present direction in units of
    # the travel, the modified Dahl model (Dahl 1968; second paper, section 2.3, whose printed
    # equations take the exponent to be one in the loading branch) reads ``dg/dx = (1 - g)**i``. It
    # has, for ``w = 1 - g``, the closed solution
    #     w0 exp(-x) for i = 1, and otherwise
    #     (w0**(1-i) + (i-1) x)**(1/(1-i)), and 0 once the bracket is negative (i < 1).
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


@dataclass(frozen=True)
class DahlParameters(NamedNumbers):
    """``theta_a = alpha theta + offset - lag y``, `y` in [-1, 1] by the Dahl equation (rad).

    Second paper, section 2.3: a modification of the Dahl model with a direct inverse that needs no
    inversion of the hysteresis.

    ValueError if a parameter is out of range or the inverse would be steeper than 40: with ``dg/dx
    = (1 - g)**i <= 2**i`` its slope is at most ``(1 + 2**i lag / travel) / alpha``.
    """

    MODEL: ClassVar[str] = 'Dahl'

    alpha: float  # ratio of actual to driving angle, in [0.2, 3]
    lag: float  # half the width of a saturated loop along the actual angle, rad
    travel: float  # rad over which the state builds up
    exponent: float  # shape, in [0.5, 4]; 1 is Dahl's own
    offset: float = 0.0  # rad

    def __post_init__(self) -> None:
        check_numbers(self.MODEL, asdict(self))
        check_range(self.MODEL, 'exponent', self.exponent, LEAST_EXPONENT, GREATEST_EXPONENT)
        check_range(self.MODEL, 'offset', self.offset, -GREATEST_OFFSET, GREATEST_OFFSET)
        check_range(self.MODEL, 'travel', self.travel, 1e-4, 100.0)
        check_inverse(self.MODEL, self)

    @property
    def inverse_slope(self) -> float:
        """Bound of the slope of the direct inverse."""
        return (1.0 + 2.0**self.exponent * self.lag / self.travel) / self.alpha

    def memory_step(self, y: float, delta: float) -> float:
        return float(dahl_step(y, delta, self.travel, self.exponent))

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        states: NDArray[np.float64] = dahl_path(driver, y0, self.travel, self.exponent)
        return states

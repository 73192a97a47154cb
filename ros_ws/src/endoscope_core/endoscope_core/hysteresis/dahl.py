"""Modified Dahl hysteresis with a shape exponent, and its direct inverse."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from endoscope_core.hysteresis.constant_lag import ConstantLag
from endoscope_core.hysteresis.dahl_kernel import dahl_path, dahl_step
from endoscope_core.hysteresis.inverse_safety import (
    GREATEST_OFFSET,
    check_inverse,
    check_numbers,
    check_range,
)
from endoscope_core.hysteresis.named_numbers import NamedNumbers

LEAST_EXPONENT = 0.5
GREATEST_EXPONENT = 4.0


@dataclass(frozen=True)
class DahlParameters(NamedNumbers, ConstantLag):
    """``theta_a = alpha theta + offset - lag y``, `y` in [-1, 1] by the Dahl equation.

    Second paper, section 2.3: a modification of the Dahl model with a direct inverse that needs no
    inversion of the hysteresis.

    Parameters
    ----------
    alpha : float
        Ratio of actual to driving angle, in [0.2, 3].
    lag : float
        Half the width of a saturated loop along the actual angle, rad.
    travel : float
        rad over which the state builds up.
    exponent : float
        Shape, in [0.5, 4]; 1 is Dahl's own.
    offset : float
        rad.

    Raises
    ------
    ValueError
        If a parameter is out of range or the inverse would be steeper than 40: with ``dg/dx = (1 -
        g)**i <= 2**i`` its slope is at most ``(1 + 2**i lag / travel) / alpha``.
    """

    MODEL: ClassVar[str] = 'Dahl'

    alpha: float
    lag: float
    travel: float
    exponent: float
    offset: float = 0.0

    def __post_init__(self) -> None:
        check_numbers(self.MODEL, asdict(self))
        check_range(self.MODEL, 'exponent', self.exponent, LEAST_EXPONENT, GREATEST_EXPONENT)
        check_range(self.MODEL, 'offset', self.offset, -GREATEST_OFFSET, GREATEST_OFFSET)
        check_range(self.MODEL, 'travel', self.travel, 1e-4, 100.0)
        check_inverse(self.MODEL, self.alpha, self.lag, self.inverse_slope)

    @property
    def inverse_slope(self) -> float:
        """Bound of the slope of the direct inverse."""
        return (1.0 + 2.0**self.exponent * self.lag / self.travel) / self.alpha

    def memory_step(self, y: float, delta: float, angle: float) -> float:
        """State after a move by `delta` rad to `angle`."""
        return float(dahl_step(y, delta, self.travel, self.exponent))

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        """States (N,) along a driving angle (N,) in rad."""
        states: NDArray[np.float64] = dahl_path(driver, y0, self.travel, self.exponent)
        return states

"""Play (backlash) with gain and offset, and an inverse whose jump is given a slope."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from endoscope_core.hysteresis.constant_lag import ConstantLag
from endoscope_core.hysteresis.dahl_kernel import play_path, play_step
from endoscope_core.hysteresis.inverse_safety import (
    GREATEST_OFFSET,
    check_inverse,
    check_numbers,
    check_range,
)
from endoscope_core.hysteresis.named_numbers import NamedNumbers


@dataclass(frozen=True)
class PlayParameters(NamedNumbers, ConstantLag):
    """``theta_a = alpha theta + offset - lag y``, ``y' = theta' / travel`` within [-1, 1].

    With ``travel = lag / alpha`` this is the play (backlash) model of Tao and Kokotovic, which the
    second paper starts from: half-gap `travel`, gain `alpha`; between the sides of the gap the
    output rests. Its exact inverse jumps by ``2 lag / alpha`` at each reversal. A shorter `travel`
    in the inverse crosses the gap within that much motion of the desired angle instead, which
    bounds its slope.

    Parameters
    ----------
    alpha : float
        Gain, in [0.2, 3].
    lag : float
        Half the width of the loop along the actual angle, rad.
    travel : float
        rad of the driving angle from the middle of the gap to its side.
    offset : float
        rad.

    Raises
    ------
    ValueError
        If a parameter is out of range or the inverse would be steeper than 40.
    """

    MODEL: ClassVar[str] = 'play'

    alpha: float
    lag: float
    travel: float
    offset: float = 0.0

    def __post_init__(self) -> None:
        check_numbers(self.MODEL, asdict(self))
        check_range(self.MODEL, 'offset', self.offset, -GREATEST_OFFSET, GREATEST_OFFSET)
        check_range(self.MODEL, 'travel', self.travel, 1e-6, 100.0)
        check_inverse(self.MODEL, self.alpha, self.lag, self.inverse_slope)

    @property
    def inverse_slope(self) -> float:
        """Greatest slope of the inverse."""
        return (1.0 + self.lag / self.travel) / self.alpha

    def memory_step(self, y: float, delta: float, angle: float) -> float:
        """State after a move by `delta` rad to `angle`."""
        return float(play_step(y, delta, self.travel))

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        """States (N,) along a driving angle (N,) in rad."""
        states: NDArray[np.float64] = play_path(driver, y0, self.travel)
        return states

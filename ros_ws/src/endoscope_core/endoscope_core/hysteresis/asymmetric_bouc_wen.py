"""Bouc-Wen hysteresis whose two directions differ, and its direct inverse."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from endoscope_core.hysteresis.asymmetric_bouc_wen_kernel import asymmetric_path
from endoscope_core.hysteresis.bouc_wen_kernel import bouc_wen_normalised_step
from endoscope_core.hysteresis.inverse_safety import (
    GREATEST_OFFSET,
    check_inverse,
    check_numbers,
    check_range,
)
from endoscope_core.hysteresis.named_numbers import NamedNumbers

GREATEST_EXPONENT = 5.0
GREATEST_SKEW = 0.5
GREATEST_ANGLE = 1.75


@dataclass(frozen=True)
class AsymmetricBoucWenParameters(NamedNumbers):
    """``theta_a = alpha theta + offset - (lag + skew theta) y`` with `y` built up by direction.

    The symmetric model (equations 3 and 4 of the first paper) in normalised form, `y` = h / h_max,
    with shape parameters of its own for either direction, as in the asymmetric extensions of the
    Bouc-Wen model (Wang and Wen 1998; Zhu and Wang 2012), a loop that may be wider at one end, and
    an offset. The state stays in [-1, 1] for a step of any size because each direction's step does
    (see `bouc_wen_normalised_step`).

    Parameters
    ----------
    alpha : float
        Ratio of actual to driving angle, in [0.2, 3].
    lag : float
        Half the width of a saturated loop at angle zero, along the actual angle, rad.
    skew : float
        Growth of that half-width with the angle, in [-0.5, 0.5]; beyond 1.75 rad it grows no more.
    offset : float
        rad.
    travel_up, travel_down : float
        rad over which the state builds up in either direction.
    rho_up, rho_down : float
        In (-1, 1]; how much faster the state leaves saturation than from rest.
    n_up, n_down : float
        Sharpness, in [1, 5].

    Raises
    ------
    ValueError
        If a parameter is out of range or the inverse would be steeper than 40.
    """

    MODEL: ClassVar[str] = 'asymmetric Bouc-Wen'

    alpha: float
    lag: float
    skew: float
    offset: float
    travel_up: float
    rho_up: float
    n_up: float
    travel_down: float
    rho_down: float
    n_down: float

    def __post_init__(self) -> None:
        name = self.MODEL
        check_numbers(name, asdict(self))
        for side in ('up', 'down'):
            check_range(name, f'travel_{side}', getattr(self, f'travel_{side}'), 1e-4, 100.0)
            check_range(name, f'rho_{side}', getattr(self, f'rho_{side}'), -1.0 + 1e-6, 1.0)
            check_range(name, f'n_{side}', getattr(self, f'n_{side}'), 1.0, GREATEST_EXPONENT)
        check_range(name, 'offset', self.offset, -GREATEST_OFFSET, GREATEST_OFFSET)
        check_range(name, 'skew', self.skew, -GREATEST_SKEW, GREATEST_SKEW)
        if abs(self.skew) > 0.9 * self.alpha:
            raise ValueError(
                f'{name} skew = {self.skew:g} must stay below 0.9 alpha = {0.9 * self.alpha:g}, '
                'or a branch turns back'
            )
        check_inverse(name, self.alpha, self.lag, self.inverse_slope)

    @property
    def inverse_slope(self) -> float:
        """Bound of the slope of the direct inverse for angles up to 1.75 rad."""
        steepest = max(
            max(1.0, 1.0 + self.rho_up) / self.travel_up,
            max(1.0, 1.0 + self.rho_down) / self.travel_down,
        )
        widest = self.lag + abs(self.skew) * GREATEST_ANGLE
        return (1.0 + abs(self.skew) + widest * steepest) / self.alpha

    def memory_step(self, y: float, delta: float, angle: float) -> float:
        """State after a move by `delta` rad to `angle`."""
        if delta >= 0.0:
            shape = self.travel_up, self.rho_up, self.n_up
        else:
            shape = self.travel_down, self.rho_down, self.n_down
        return float(bouc_wen_normalised_step(y, delta, *shape))

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        """States (N,) along a driving angle (N,) in rad."""
        states: NDArray[np.float64] = asymmetric_path(
            driver,
            y0,
            (self.travel_up, self.rho_up, self.n_up),
            (self.travel_down, self.rho_down, self.n_down),
        )
        return states

    def lag_at(self, angle: float) -> float:
        """Half-width of the loop at an angle, rad; never negative."""
        bounded = min(GREATEST_ANGLE, max(-GREATEST_ANGLE, angle))
        return max(0.0, self.lag + self.skew * bounded)

    def lags_at(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same for many angles (N,)."""
        bounded = np.clip(angles, -GREATEST_ANGLE, GREATEST_ANGLE)
        lags: NDArray[np.float64] = np.maximum(0.0, self.lag + self.skew * bounded)
        return lags

"""Symmetric Bouc-Wen hysteresis and its direct inverse (equations 3 to 5 of the first paper)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from endoscope_core.hysteresis.bouc_wen_kernel import (
    bouc_wen_normalised_path,
    bouc_wen_normalised_step,
)
from endoscope_core.hysteresis.constant_lag import ConstantLag
from endoscope_core.hysteresis.inverse_safety import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    GREATEST_LAG,
    SMALLEST_ALPHA,
    check_numbers,
)
from endoscope_core.hysteresis.named_numbers import NamedNumbers

GREATEST_EXPONENT = 5.0


@dataclass(frozen=True)
class BoucWenParameters(NamedNumbers, ConstantLag):
    """The six parameters of equations 3 to 5, refused unless their inverse is safe to drive with.

    ``theta_a = alpha theta + beta h`` and ``h' = A theta' - B |theta'| |h|^(n-1) h - C theta'
    |h|^n``.

    Parameters
    ----------
    alpha : float
        Ratio of actual to driving angle, dimensionless, in [0.2, 3]: the inverse divides by it.
    beta : float
        Weight of the hysteresis, dimensionless, at most 0: the actual angle lags behind.
    A, B, C, n : float
        Shape; ``A > 0``, ``B > 0``, ``B + C > 0``, ``1 <= n <= 5``. With `theta` in rad, `h` is in
        rad where A is dimensionless, and B and C are in rad^-n.

    Raises
    ------
    ValueError
        If a parameter is not finite or out of its range, the lag ``|beta| h_max`` exceeds 120 deg,
        or the inverse would somewhere be steeper than 40.

    Notes
    -----
    ``|h| <= h_max = (A / (B + C))^(1/n)`` always (invariance, Ikhouane and Rodellar 2007), so that
    ``|theta_FF| <= (|theta_d| + |beta| h_max) / alpha``, and with ``|dh/dtheta| <= A max(1, 1 +
    rho)``, ``rho = (B - C) / (B + C)``, the inverse's slope ``|d theta_FF / d theta_d| <= (1 +
    |beta| A max(1, 1 + rho)) / alpha``. ``B > 0`` makes ``dh/dtheta`` positive on the whole of
    ``|h| < h_max``, so that the inverse is strictly increasing on every branch. The six parameters
    hold one redundancy: scaling `h` changes nothing (Ma et al. 2004). `identify` therefore returns
    A = 1.
    """

    MODEL: ClassVar[str] = 'Bouc-Wen'

    alpha: float
    beta: float
    A: float
    B: float
    C: float
    n: float

    def __post_init__(self) -> None:
        check_numbers(self.MODEL, asdict(self))
        checks = [
            (
                SMALLEST_ALPHA <= self.alpha <= GREATEST_ALPHA,
                f'alpha = {self.alpha:g} must lie in [{SMALLEST_ALPHA:g}, {GREATEST_ALPHA:g}]',
            ),
            (self.beta <= 0.0, f'beta = {self.beta:g} must not be positive'),
            (self.A > 0.0, f'A = {self.A:g} must be positive'),
            (self.B > 0.0, f'B = {self.B:g} must be positive'),
            (self.B + self.C > 0.0, f'B + C = {self.B + self.C:g} must be positive'),
            (
                1.0 <= self.n <= GREATEST_EXPONENT,
                f'n = {self.n:g} must lie in [1, {GREATEST_EXPONENT:g}]',
            ),
        ]
        for holds, message in checks:
            if not holds:
                raise ValueError(f'Bouc-Wen parameter {message}')
        if self.lag > GREATEST_LAG * (1.0 + 1e-9):
            raise ValueError(
                f'Bouc-Wen lag |beta| h_max = {math.degrees(self.lag):.1f} deg exceeds '
                f'{math.degrees(GREATEST_LAG):.0f} deg'
            )
        if self.inverse_slope > GREATEST_INVERSE_SLOPE * (1.0 + 1e-9):
            raise ValueError(
                f'Bouc-Wen inverse is too steep: {self.inverse_slope:.1f} '
                f'exceeds {GREATEST_INVERSE_SLOPE:g}'
            )

    @cached_property
    def h_max(self) -> float:
        """Bound of ``|h|``."""
        return (self.A / (self.B + self.C)) ** (1.0 / self.n)

    @cached_property
    def lag(self) -> float:
        """``|beta| h_max`` in rad: half the width of a saturated loop along the actual angle."""
        return -self.beta * self.h_max

    @cached_property
    def travel(self) -> float:
        """``h_max / A`` in rad: distance over which the state builds up."""
        return self.h_max / self.A

    @cached_property
    def rho(self) -> float:
        """``(B - C) / (B + C)``: how much faster the state leaves saturation than from rest."""
        return (self.B - self.C) / (self.B + self.C)

    @cached_property
    def inverse_slope(self) -> float:
        """Greatest slope of ``theta_FF`` over ``theta_d``."""
        return (1.0 - self.beta * self.A * max(1.0, 1.0 + self.rho)) / self.alpha

    @property
    def offset(self) -> float:
        """Equation 3 has none."""
        return 0.0

    def memory_step(self, y: float, delta: float, angle: float) -> float:
        """``h / h_max`` after a move by `delta` rad to `angle`."""
        return float(bouc_wen_normalised_step(y, delta, self.travel, self.rho, self.n))

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        """``h / h_max`` (N,) along a driving angle (N,) in rad."""
        states: NDArray[np.float64] = bouc_wen_normalised_path(
            driver, y0, self.travel, self.rho, self.n
        )
        return states

    @classmethod
    def from_shape(
        cls, alpha: float, lag: float, travel: float, rho: float, n: float
    ) -> BoucWenParameters:
        """Parameters with A = 1 from quantities that can be pictured.

        Parameters
        ----------
        alpha : float
            Ratio of actual to driving angle.
        lag : float
            Half the width of a saturated loop along the actual angle, rad.
        travel : float
            Distance over which the hysteresis builds up, rad.
        rho : float
            In (-1, 1]; 1 means C = 0.
        n : float
            Sharpness.
        """
        total = travel ** (-n)
        return cls(
            alpha=alpha,
            beta=-lag / travel,
            A=1.0,
            B=0.5 * (1.0 + rho) * total,
            C=0.5 * (1.0 - rho) * total,
            n=n,
        )

"""Bouc-Wen hysteresis (equations 3 to 5 of the first paper)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled import njit
from endoscope_core.hysteresis.memory_model import (
    NamedNumbers,
    check_inverse,
    check_numbers,
    check_range,
)

_LONGEST_SUBSTEP = 0.1
_MOST_SUBSTEPS = 64
GREATEST_EXPONENT = 5.0


# With ``y = h / h_max``, ``h_max = (A / (B + C))**(1/n)``, ``rho = (B - C) / (B + C)``, and ``x``
# the distance travelled in the present direction in units of ``h_max / A``, equation 4 of the first
# paper becomes, for ``g = y sgn(theta')``,
#     dg/dx = 1 - g**n            for g >= 0
#     dg/dx = 1 + rho |g|**n      for g < 0
# an autonomous equation without time: only the travel of the angle counts, not its speed.


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
def bouc_wen_path(
    driver: NDArray[np.float64], y0: float, travel: float, rho: float, n: float
) -> NDArray[np.float64]:
    """Normalised states along a driving angle (N,) in rad, `y0` at the first sample."""
    states = np.empty(driver.size)
    y = y0
    previous = driver[0]
    for k in range(driver.size):
        y = bouc_wen_normalised_step(y, driver[k] - previous, travel, rho, n)
        previous = driver[k]
        states[k] = y
    return states


@dataclass(frozen=True)
class BoucWenParameters(NamedNumbers):
    """The six parameters of equations 3 to 5, refused unless their inverse is safe to drive with.

    ``theta_a = alpha theta + beta h`` and ``h' = A theta' - B |theta'| |h|^(n-1) h - C theta'
    |h|^n``.

    ValueError if a parameter is not finite or out of its range, the lag ``|beta| h_max`` exceeds
    120 deg, or the inverse would somewhere be steeper than 40.

    ``|h| <= h_max = (A / (B + C))^(1/n)`` always (invariance, Ikhouane and Rodellar 2007), so that
    ``|theta_FF| <= (|theta_d| + |beta| h_max) / alpha``, and with ``|dh/dtheta| <= A max(1, 1 +
    rho)``, ``rho = (B - C) / (B + C)``, the inverse's slope ``|d theta_FF / d theta_d| <= (1 +
    |beta| A max(1, 1 + rho)) / alpha``. ``B > 0`` makes ``dh/dtheta`` positive on the whole of
    ``|h| < h_max``, so that the inverse is strictly increasing on every branch. The six parameters
    hold one redundancy: scaling `h` changes nothing (Ma et al. 2004). `identify` therefore returns
    A = 1.
    """

    MODEL: ClassVar[str] = 'Bouc-Wen'

    # Ratio of actual to driving angle, dimensionless, in [0.2, 3]: the inverse divides by it.
    alpha: float
    beta: float  # weight of the hysteresis, dimensionless, at most 0: the actual angle lags behind
    # Shape; ``A > 0``, ``B > 0``, ``B + C > 0``, ``1 <= n <= 5``. With `theta` in rad, `h` is in
    # rad where A is dimensionless, and B and C are in rad^-n.
    A: float
    B: float
    C: float
    n: float

    def __post_init__(self) -> None:
        check_numbers(self.MODEL, asdict(self))
        check_range(self.MODEL, 'n', self.n, 1.0, GREATEST_EXPONENT)
        if self.beta > 0.0:
            raise ValueError(f'Bouc-Wen parameter beta = {self.beta:g} must not be positive')
        for name, value in (('A', self.A), ('B', self.B), ('B + C', self.B + self.C)):
            if not value > 0.0:
                raise ValueError(f'Bouc-Wen parameter {name} = {value:g} must be positive')
        check_inverse(self.MODEL, self)

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

    def memory_step(self, y: float, delta: float) -> float:
        return float(bouc_wen_normalised_step(y, delta, self.travel, self.rho, self.n))

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        states: NDArray[np.float64] = bouc_wen_path(driver, y0, self.travel, self.rho, self.n)
        return states

    @classmethod
    def from_shape(
        cls, alpha: float, lag: float, travel: float, rho: float, n: float
    ) -> BoucWenParameters:
        """Parameters with A = 1 from half-width `lag` and rise `travel` of a loop, both in rad."""
        total = travel ** (-n)
        return cls(
            alpha=alpha,
            beta=-lag / travel,
            A=1.0,
            B=0.5 * (1.0 + rho) * total,
            C=0.5 * (1.0 - rho) * total,
            n=n,
        )

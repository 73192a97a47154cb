"""Hysteresis models with one memory in [-1, 1]: forward, and inverse without inversion."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray


class MemoryModel(Protocol):
    """``theta_a = alpha theta + offset - lag(theta) y``: Bouc-Wen, Dahl and play are of this form.

    The direct inverse (equation 5 of the first paper, section 2.3 of the second) drives `y` with
    the desired angle and puts out ``(theta_d - offset + lag(theta_d) y) / alpha``.
    """

    @property
    def alpha(self) -> float:
        """Ratio of actual to driving angle."""
        ...

    @property
    def offset(self) -> float:
        """Actual angle where the driving angle and the memory are zero, rad."""
        ...

    @property
    def inverse_slope(self) -> float:
        """Bound of the slope of the direct inverse."""
        ...

    def lag_at(self, angle: float) -> float:
        """Half-width of a saturated loop along the actual angle, rad."""
        ...

    def lags_at(self, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same for many angles (N,)."""
        ...

    def memory_step(self, y: float, delta: float, angle: float) -> float:
        """Memory after a move by `delta` rad to `angle`."""
        ...

    def memory_path(self, driver: NDArray[np.float64], y0: float) -> NDArray[np.float64]:
        """Memory (N,) along a driving angle (N,), `y0` at the first sample."""
        ...

    def to_dict(self) -> dict[str, float]:
        """Parameters by name."""
        ...


def forward(model: MemoryModel, theta: ArrayLike, y0: float = 0.0) -> NDArray[np.float64]:
    """Actual angle (N,) for a driving angle (N,), both in rad; the memory begins at `y0`."""
    driver = _series(theta)
    lags = model.lags_at(driver)
    result: NDArray[np.float64] = (
        model.alpha * driver + model.offset - lags * model.memory_path(driver, y0)
    )
    return result


def direct_inverse(model: MemoryModel, theta_d: ArrayLike, y0: float = 0.0) -> NDArray[np.float64]:
    """Command (N,) for a desired angle (N,), both in rad; the memory begins at `y0`."""
    driver = _series(theta_d)
    lags = model.lags_at(driver)
    result: NDArray[np.float64] = (
        driver - model.offset + lags * model.memory_path(driver, y0)
    ) / model.alpha
    return result


def _series(values: ArrayLike) -> NDArray[np.float64]:
    series = np.ascontiguousarray(values, dtype=float)
    if series.ndim != 1 or series.size == 0 or not np.all(np.isfinite(series)):
        raise ValueError(
            'the driving angle must be a non-empty series of finite numbers; '
            f'its shape is {series.shape}'
        )
    return series

"""Hysteresis whose loops are equally wide at every angle."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class _WithLag(Protocol):
    @property
    def lag(self) -> float: ...


class ConstantLag:
    """One `lag` of a `MemoryModel`: a saturated loop's half-width along the actual angle, rad."""

    def lag_at(self: _WithLag, angle: float) -> float:
        """Half-width of the loop, rad."""
        return self.lag

    def lags_at(self: _WithLag, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same for many angles (N,)."""
        return np.full(angles.shape, self.lag)

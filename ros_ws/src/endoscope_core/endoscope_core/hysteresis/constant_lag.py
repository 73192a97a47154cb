"""Hysteresis whose loops are equally wide at every angle."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class _WithLag(Protocol):
    @property
    def lag(self) -> float: ...


class ConstantLag:
    """The lag of a :class:`~endoscope_core.hysteresis.memory_model.MemoryModel` with one ``lag``.

    That is the half-width of a saturated loop along the actual angle, in rad.
    """

    def lag_at(self: _WithLag, angle: float) -> float:
        """Half-width of the loop, rad."""
        return self.lag

    def lags_at(self: _WithLag, angles: NDArray[np.float64]) -> NDArray[np.float64]:
        """The same for many angles (N,)."""
        return np.full(angles.shape, self.lag)

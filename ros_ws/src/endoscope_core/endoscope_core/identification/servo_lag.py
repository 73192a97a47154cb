"""The position servo between a command and the motor: second order, as in the nominal plant."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import JointParameters


@dataclass(frozen=True)
class Servo:
    """Bandwidth in rad/s and damping ratio of the position loop."""

    bandwidth: float = JointParameters.motor_bandwidth
    damping_ratio: float = JointParameters.motor_damping_ratio

    @property
    def lag(self) -> float:
        """Time in s by which it follows a steady motion late."""
        return 2.0 * self.damping_ratio / self.bandwidth

    def answer(self, command: NDArray[np.float64], dt: float) -> NDArray[np.float64]:
        """Motor angle (N,) for a command (N,) held for `dt` s each, beginning at rest on it."""
        # A node imports this module and never asks: scipy.signal is 26 MB of its memory.
        from scipy.signal import lfilter

        numerator, denominator = _filter(self.bandwidth, self.damping_ratio, dt)
        start = command[0]
        moved: NDArray[np.float64] = lfilter(numerator, denominator, command - start)
        return start + moved


@lru_cache
def _filter(w: float, z: float, dt: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    from scipy.signal import cont2discrete

    numerator, denominator, _ = cont2discrete(([w * w], [1.0, 2.0 * z * w, w * w]), dt)
    return numerator[0], denominator

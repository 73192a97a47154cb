"""Noise and quantisation of the rig's sensors."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.plant.parameters import SensorParameters

Array = NDArray[np.float64]


def quantise(values: ArrayLike, step: float) -> Array:
    """Round to multiples of `step`; a step of zero leaves the values as they are."""
    values = np.asarray(values, dtype=float)
    return values if step == 0 else np.rint(values / step) * step


class SensorModel:
    """White, independent noise and quantisation of each sensor, reproducible by its seed.

    Each sensor draws from a stream of its own: what one reads does not depend on how often
    another one is asked. Every method takes noise-free values of any shape and returns readings of
    that shape.
    """

    def __init__(self, sensors: SensorParameters, seed: int) -> None:
        self._sensors = sensors
        cells, tracker, effort = np.random.SeedSequence(seed).spawn(3)
        self._cells = np.random.default_rng(cells)
        self._tracker = np.random.default_rng(tracker)
        self._effort = np.random.default_rng(effort)

    def tension(self, tension: ArrayLike) -> Array:
        """Load-cell readings in N."""
        tension = np.asarray(tension, dtype=float)
        noise = self._sensors.load_cell_noise * self._cells.standard_normal(tension.shape)
        return quantise(tension + noise, self._sensors.load_cell_resolution)

    def bending(self, angle: ArrayLike) -> Array:
        """Bending angle in rad from the tracker."""
        angle = np.asarray(angle, dtype=float)
        return angle + self._sensors.tracker_noise * self._tracker.standard_normal(angle.shape)

    def shaft_position(self, angle: ArrayLike) -> Array:
        """Encoder reading in rad."""
        return quantise(angle, 2.0 * math.pi / self._sensors.encoder_counts)

    def shaft_velocity(self, speed: ArrayLike) -> Array:
        """Servo's velocity reading in rad/s."""
        return quantise(speed, self._sensors.velocity_resolution)

    def shaft_effort(self, effort: ArrayLike) -> Array:
        """Torque in N m from the servo's current."""
        effort = np.asarray(effort, dtype=float)
        noise = self._sensors.effort_noise * self._effort.standard_normal(effort.shape)
        return quantise(effort + noise, self._sensors.effort_resolution)

"""Inverse of a plant with any effects, for a motion that is known beforehand.

`PhysicalInverse` knows the nominal plant alone. A plant file may hold any effect of the catalogue.
Iterative learning control inverts it all the same: simulate, see how far the tip is from where it
shall be a servo's lag later, correct the command there, and again (Arimoto, Kawamura, Miyazaki,
Journal of Robotic Systems 1(2), 1984; Bristow, Tharayil, Alleyne, IEEE Control Systems Magazine
26(3), 2006).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.control.limits import shipped_limits
from endoscope_core.control.physical_inverse import PhysicalInverse
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.simulator import TICK, simulate

Array = NDArray[np.float64]

ITERATIONS = 40
GAIN = 0.6
"""Share of the error that the first correction takes away; the joint's own gain is near one."""
BOLDER, HALVED = 1.1, 0.5
"""Factors on that share after a correction that helped and one that did not."""
SMOOTHING_S = 0.012
"""Standard deviation of the filter on each correction: nothing faster than the servo is learnt."""


@dataclass(frozen=True)
class PlannedCommand:
    """A command for a known motion."""

    command: Array  # joint-equivalent (N, J), rad, one for each tick of 1 ms
    bending: Array  # what the plant's tip is expected to do (N, J), rad
    rmse: float  # of the expected tip, rad


def iterated_inverse(
    plant: PlantDescription, desired: Array, velocity: Array, iterations: int = ITERATIONS
) -> PlannedCommand:
    """Command under which a plant, with its effects, moves as desired: that of the best iteration.

    `desired` (N, J) in rad and `velocity` (N, J) in rad/s are at every tick of 1 ms, from rest at
    zero. The command stays within the motor's travel, so that an angle that cannot be reached does
    not wind it up. A ValueError if the motion is not finite, has not a column for each joint, or
    the plant is invalid.
    """
    desired, velocity = np.asarray(desired, dtype=float), np.asarray(velocity, dtype=float)
    names = plant.joint_names()
    if desired.ndim != 2 or desired.shape != velocity.shape or desired.shape[1] != len(names):
        raise ValueError(
            f'a motion of {", ".join(names)} has angles {desired.shape} and speeds {velocity.shape}'
        )
    if not (np.isfinite(desired).all() and np.isfinite(velocity).all()):
        raise ValueError('the desired motion is not finite')
    limits = shipped_limits()
    travel = limits.travel / limits.gear
    laws = [PhysicalInverse(PhysicalParameters(plant.joints[name])) for name in names]
    lead = [max(1, round(law.servo_lag / TICK)) for law in laws]
    command = np.stack(
        [_by_law(law, desired[:, j], velocity[:, j]) for j, law in enumerate(laws)], axis=1
    )
    best = best_tip = command
    lowest = np.full(len(names), np.inf)
    gain = np.full(len(names), GAIN)
    for _ in range(max(iterations, 1)):
        tip = simulate(plant, limits.gear * command).bending_true
        squares = np.mean((desired - tip) ** 2, axis=0)
        better = squares < lowest
        best, best_tip = np.where(better, command, best), np.where(better, tip, best_tip)
        lowest = np.where(better, squares, lowest)
        gain *= np.where(better, BOLDER, HALVED)
        ahead = np.stack(
            [_earlier(e, n) for e, n in zip((desired - best_tip).T, lead, strict=True)]
        )
        step = gaussian_filter1d(ahead, SMOOTHING_S / TICK, axis=1, mode='nearest').T
        command = np.clip(best + gain * step, -travel, travel)
    return PlannedCommand(best, best_tip, float(np.sqrt(np.mean(lowest))))


def _by_law(law: PhysicalInverse, desired: Array, velocity: Array) -> Array:
    command = np.empty(len(desired))
    command[0] = law.begin(0.0, float(desired[0]), float(velocity[0]))
    for k in range(1, len(desired)):
        command[k] = law.wanted(float(desired[k]), float(velocity[k]), TICK)
    return command


def _earlier(values: Array, ticks: int) -> Array:
    """Return the values of `ticks` later, the last one held."""
    return np.concatenate([values[ticks:], np.full(min(ticks, len(values)), values[-1])])

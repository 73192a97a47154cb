"""Motions that the master plays: a named motion or a file, sampled once, read tick by tick."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_core.names import JOINTS
from endoscope_core.signals.command_file import read_command_file
from endoscope_core.signals.motions import motion_by_name
from endoscope_core.signals.signal import move

Array = NDArray[np.float64]

# A minimum-jerk move peaks at 1.875 times its mean speed.
_PEAK_OF_MEAN = 1.875
_SHORTEST_S = 0.2


class SampledMotion:
    """Angles and velocities (N, J) in rad, rad/s at N ticks; NaN for a joint that stays."""

    def __init__(self, angle: Array, velocity: Array) -> None:
        self._angle: list[list[float]] = angle.tolist()
        self._velocity: list[list[float]] = velocity.tolist()

    def __len__(self) -> int:
        return len(self._angle)

    def at(self, tick: int, stay: Sequence[float]) -> tuple[list[float], list[float]]:
        """Angles and velocities (J,) at a tick; joints that do not move are at `stay` (J,)."""
        # The last row holds beyond the end.
        row = min(tick, len(self._angle) - 1)
        angle = [s if math.isnan(a) else a for a, s in zip(self._angle[row], stay, strict=True)]
        return angle, [0.0 if math.isnan(v) else v for v in self._velocity[row]]


def sample_motion(name: str, joints: Sequence[str], tick: float) -> SampledMotion:
    """Sample a named motion, every `tick` s, of `joints`; the others stay where they are."""
    motion = motion_by_name(name)
    time = np.arange(round(motion.duration / tick) + 1) * tick
    angle = np.full((len(time), len(JOINTS)), np.nan)
    velocity = np.full_like(angle, np.nan)
    for column, joint in enumerate(JOINTS):
        if joint in joints and joint in motion.joints:
            angle[:, column], velocity[:, column] = motion.joints[joint](time)
        elif joint in joints:
            angle[:, column] = velocity[:, column] = 0.0
    return SampledMotion(angle, velocity)


def load_command_file(path: Path, tick: float) -> SampledMotion:
    """Sample a command file every `tick` s, interpolating between its rows."""
    return SampledMotion(*read_command_file(path, JOINTS).sampled(tick))


def approach(
    start: Sequence[float], end: Sequence[float], speed: float, tick: float
) -> SampledMotion:
    """A minimum-jerk motion (J,) in rad at up to `speed` rad/s, a row every `tick` s."""
    distance = float(np.max(np.abs(np.subtract(end, start))))
    duration = max(_SHORTEST_S, _PEAK_OF_MEAN * distance / speed)
    time = np.arange(math.ceil(duration / tick)) * tick
    legs = [move(a, b, duration)(time) for a, b in zip(start, end, strict=True)]
    return SampledMotion(*(np.stack([leg[k] for leg in legs], axis=1) for k in (0, 1)))

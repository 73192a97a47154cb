"""Commands that the console plays: a named motion or a file, sampled once, read tick by tick."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_core.signals import Motion, motion_by_name, move
from endoscope_core.signals.command_file import read_command_file
from endoscope_nodes.names import JOINTS

Array = NDArray[np.float64]


class SampledMotion:
    """Desired angles and velocities at the ticks of a motion.

    Parameters
    ----------
    angle, velocity
        rad and rad/s, shape (N, J), one row a tick.
    """

    def __init__(self, angle: Array, velocity: Array) -> None:
        self._rows: list[list[float]] = np.hstack([angle, velocity]).tolist()

    def __len__(self) -> int:
        return len(self._rows)

    def row(self, tick: int) -> list[float]:
        """Angles, then velocities, at a tick; the last row beyond the end."""
        return self._rows[min(tick, len(self._rows) - 1)]


def sample_motion(
    name: str, joints: tuple[str, ...], start: tuple[float, ...], tick: float, approach_speed: float
) -> SampledMotion:
    """Sample a named motion for some of the joints, with an approach from where they are.

    Parameters
    ----------
    joints
        Those that move; the others stay where they are.
    start
        Commanded angles now, rad, shape (J,).
    tick
        In s.
    approach_speed
        Largest speed in rad/s on the way to the motion's first angle.

    Raises
    ------
    ValueError
        There is no motion of that name.
    """
    motion = motion_by_name(name)
    time = np.arange(round(motion.duration / tick) + 1) * tick
    angle, velocity = _columns(motion, time)
    for column, joint in enumerate(JOINTS):
        if joint not in joints:
            angle[:, column] = start[column]
            velocity[:, column] = 0.0
    return _with_approach(angle, velocity, start, tick, approach_speed)


def _columns(motion: Motion, time: NDArray[np.floating]) -> tuple[Array, Array]:
    angle = np.zeros((len(time), len(JOINTS)))
    velocity = np.zeros_like(angle)
    for column, joint in enumerate(JOINTS):
        if joint in motion.joints:
            angle[:, column], velocity[:, column] = motion.joints[joint](time)
    return angle, velocity


def load_command_file(
    path: Path, start: tuple[float, ...], tick: float, approach_speed: float
) -> SampledMotion:
    """Sample a command file, interpolating between its rows.

    Raises
    ------
    CommandFileError
        The file cannot be played.
    """
    table = read_command_file(path, JOINTS)
    first, last = table.time[0], table.time[-1]
    time = np.arange(math.floor((last - first) / tick + 1e-6) + 1) * tick + first
    angle = np.stack([np.interp(time, table.time, column) for column in table.angle.T], axis=1)
    velocity = np.gradient(angle, tick, axis=0) if len(time) > 1 else np.zeros_like(angle)
    velocity[-1] = 0.0
    return _with_approach(angle, velocity, start, tick, approach_speed)


def _with_approach(
    angle: Array, velocity: Array, start: tuple[float, ...], tick: float, speed: float
) -> SampledMotion:
    distance = float(np.max(np.abs(angle[0] - np.asarray(start))))
    if distance == 0.0:
        return SampledMotion(angle, velocity)
    # The peak speed of a minimum-jerk move is 1.875 times its mean.
    duration = max(0.2, 1.875 * distance / speed)
    time = np.arange(math.ceil(duration / tick)) * tick
    legs = [move(a, float(b), duration)(time) for a, b in zip(start, angle[0], strict=True)]
    approach = np.stack([leg[0] for leg in legs], axis=1)
    approach_velocity = np.stack([leg[1] for leg in legs], axis=1)
    return SampledMotion(np.vstack([approach, angle]), np.vstack([approach_velocity, velocity]))

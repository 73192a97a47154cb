"""Motions that the master plays: a named motion or a file, sampled once, read tick by tick."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import FileError
from endoscope_core.names import JOINTS
from endoscope_core.signals.motions import motion_by_name
from endoscope_core.signals.signal import move

Array = NDArray[np.float64]

TIME = 'time'
# A minimum-jerk move peaks at 1.875 times its mean speed.
_PEAK_OF_MEAN = 1.875
_SHORTEST_S = 0.2


@dataclass(frozen=True)
class CommandTable:
    """A sampled motion of J joints."""

    joints: tuple[str, ...]  # columns of `angle`
    time: Array  # (N,) in s, increasing
    angle: Array  # (N, J): desired bending angles in rad

    def sampled(self, tick: float) -> tuple[Array, Array]:
        """Angles and velocities at every `tick` in s, in rad and rad/s, both of shape (M, J)."""
        first, last = self.time[0], self.time[-1]
        time = np.arange(math.floor((last - first) / tick + 1e-6) + 1) * tick + first
        angle = np.stack([np.interp(time, self.time, column) for column in self.angle.T], axis=1)
        velocity = np.gradient(angle, tick, axis=0) if len(time) > 1 else np.zeros_like(angle)
        velocity[-1] = 0.0
        return angle, velocity


def write_command_file(
    path: str | Path, time: ArrayLike, angle: ArrayLike, joints: Sequence[str] = JOINTS
) -> None:
    """Write time (N,) in s and angle (N, J) in rad, whole or not at all; else FileError."""
    time, angle = np.asarray(time, float), np.asarray(angle, float)
    table = CommandTable(tuple(joints), time, angle)
    _check(table, str(path))
    lines = [','.join([TIME, *joints])]
    lines += [
        ','.join([f'{t:.4f}', *(f'{a:.6f}' for a in row)])
        for t, row in zip(time, angle, strict=True)
    ]
    write_text(path, '\n'.join(lines) + '\n')


def read_command_file(path: str | Path, joints: Sequence[str] = JOINTS) -> CommandTable:
    """Read a command file into the order of `joints`; FileError where it is not usable."""
    path = Path(path)
    wanted = (TIME, *joints)
    try:
        with path.open(newline='', encoding='utf-8') as file:
            reader = csv.DictReader(file)
            columns = list(reader.fieldnames or ())
            doubled = [c for c in wanted if columns.count(c) > 1]
            if doubled:
                raise FileError(f'{path}: two columns {", ".join(doubled)}')
            missing = [c for c in wanted if c not in columns]
            if missing:
                raise FileError(f'{path}: no column {", ".join(missing)}')
            rows = [_numbers(path, reader.line_num, row, wanted) for row in reader]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f'{path} cannot be read: {error}') from error
    if len(rows) < 2:
        raise FileError(f'{path}: fewer than two rows')
    numbers = np.array(rows)
    table = CommandTable(tuple(joints), numbers[:, 0], numbers[:, 1:])
    _check(table, str(path))
    return table


def _numbers(path: Path, line: int, row: dict[str, str], wanted: Sequence[str]) -> list[float]:
    try:
        values = [float(row[name]) for name in wanted]
    except (TypeError, ValueError) as error:
        raise FileError(f'{path}: line {line} holds something else than numbers') from error
    if not all(math.isfinite(value) for value in values):
        raise FileError(f'{path}: line {line} holds a value that is not finite')
    return values


def _check(table: CommandTable, name: str) -> None:
    if table.angle.shape != (len(table.time), len(table.joints)) or len(table.time) < 2:
        raise FileError(f'{name}: {len(table.time)} times for angles of shape {table.angle.shape}')
    if not (np.isfinite(table.time).all() and np.isfinite(table.angle).all()):
        raise FileError(f'{name}: a value is not finite')
    # Differences of neighbours can overflow; the order cannot.
    backward = np.flatnonzero(table.time[1:] <= table.time[:-1])
    if len(backward):
        raise FileError(f'{name}: time does not increase at line {backward[0] + 3}')


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

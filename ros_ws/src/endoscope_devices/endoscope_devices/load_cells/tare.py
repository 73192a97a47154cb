"""Takes the wires' tension of the last second as zero, and keeps it."""

import datetime
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import EndoscopeError, FileError
from endoscope_core.schema import load
from endoscope_devices.load_cells.calibration_file import Count, LoadCellCalibration, TareLimits

WINDOW_NS = 1_000_000_000
_FEWEST = 20


class TareError(EndoscopeError, RuntimeError):
    """The wires cannot be tared now; the message says why."""


class TareWindow:
    """Readings of W wires in the last second, of which a zero can be made."""

    def __init__(self, wires: Sequence[str], limits: TareLimits) -> None:
        self._wires = tuple(wires)
        self._limits = limits
        self._readings: deque[tuple[int, tuple[float, ...]]] = deque()
        self._moved_ns: int | None = None

    def add(self, time_ns: int, tension: tuple[float, ...]) -> None:
        """Take a good reading (W,) in N at a monotonic time in ns."""
        self._readings.append((time_ns, tension))
        while self._readings[0][0] < time_ns - WINDOW_NS:
            self._readings.popleft()

    def note_shafts(self, time_ns: int, velocity: Sequence[float]) -> None:
        """Take the speed of the motor shafts (J,) in rad/s, at ns of the same clock."""
        if any(not abs(v) <= self._limits.shaft_speed for v in velocity):
            self._moved_ns = time_ns

    def mean(self, now_ns: int) -> tuple[float, ...]:
        """Mean tension (W,) of the last second in N; TareError where it is unfit to be a zero."""
        since = now_ns - WINDOW_NS
        values = np.array([tension for time_ns, tension in self._readings if time_ns >= since])
        if len(values) < _FEWEST:
            raise TareError(
                f'{len(values)} good readings in the last second, {_FEWEST} are needed: see the '
                'diagnostics of the load cells'
            )
        if self._moved_ns is not None and self._moved_ns >= since:
            raise TareError('the wires move: let the motors rest for a second')
        mean = values.mean(axis=0)
        half = len(values) // 2
        drift = np.abs(values[:half].mean(axis=0) - values[half:].mean(axis=0))
        for what, found, allowed in (
            ('changes by', drift, self._limits.drift),
            ('is noisy by', values.std(axis=0), self._limits.noise),
            ('is', np.abs(mean), self._limits.largest),
        ):
            worst = int(np.argmax(found))
            if found[worst] > allowed:
                raise TareError(
                    f'{self._wires[worst]} {what} {found[worst]:.3g} N, at most {allowed:.3g} N '
                    'can be tared: slacken the wires and let them rest'
                )
        return tuple(mean.tolist())


def with_zero(calibration: LoadCellCalibration, zero: Sequence[float]) -> LoadCellCalibration:
    """The calibration with other zeros: counts without tension, one a wire in its order."""
    cells = {
        name: replace(cell, zero=float(count))
        for (name, cell), count in zip(calibration.wires.items(), zero, strict=True)
    }
    return replace(calibration, wires=cells)


def zero_after_tare(calibration: LoadCellCalibration, tension: Sequence[float]) -> list[float]:
    """Counts without tension, one a wire, once a ``tension`` (W,) in N is taken for zero."""
    return [
        cell.zero + cell.sign * value / cell.newton_per_count
        for cell, value in zip(calibration.wires.values(), tension, strict=True)
    ]


def tare_path(calibration: str | Path) -> Path:
    """Where the tare of a calibration file is kept: beside it."""
    return Path(calibration).with_suffix('.tare.yaml')


def save_tare(path: str | Path, calibration: LoadCellCalibration) -> None:
    """Keep the zeros of a calibration in the file of :func:`tare_path`."""
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec='seconds')
    content = {
        'calibration_sha256': calibration.digest,
        'tared': now,
        'zero': {name: cell.zero for name, cell in calibration.wires.items()},
    }
    write_text(path, yaml.safe_dump(content, sort_keys=False))


def apply_saved_tare(path: str | Path, calibration: LoadCellCalibration) -> LoadCellCalibration:
    """The calibration, as read from its file, with the zeros that were kept, if any were.

    FileError where the tare cannot be read, or belongs to another state of the calibration file.
    """
    if not Path(path).exists():
        return calibration
    tare = load(_Tare, path, 'tare')
    if tare.calibration_sha256 != calibration.digest:
        raise FileError(
            f'tare {path} was taken with another calibration: remove it, then tare again'
        )
    if set(tare.zero) != set(calibration.wires):
        raise FileError(
            f'tare {path}: zero has {", ".join(tare.zero)}: give {", ".join(calibration.wires)}'
        )
    return with_zero(calibration, [tare.zero[name] for name in calibration.wires])


@dataclass(frozen=True)
class _Tare:
    calibration_sha256: str
    zero: Mapping[str, Count]
    tared: Any = None

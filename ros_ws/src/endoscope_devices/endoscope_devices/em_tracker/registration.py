"""Registers the straight instrument from the last second of readings, and keeps the result."""

import datetime
import math
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import FileError
from endoscope_core.kinematics import StraightRegistration, register_straight
from endoscope_core.schema import load
from endoscope_devices.em_tracker.aurora_tracker import TrackerReading

WINDOW_NS = 1_000_000_000


class RegistrationWindow:
    """The readings of the last second."""

    def __init__(self) -> None:
        self._readings: deque[TrackerReading] = deque()

    def add(self, reading: TrackerReading) -> None:
        """Take a reading."""
        self._readings.append(reading)
        while self._readings[0].time_ns < reading.time_ns - WINDOW_NS:
            self._readings.popleft()

    def register(self, now_ns: int) -> StraightRegistration:
        """Average them at `now_ns` of ``time.monotonic_ns``; RegistrationError if the tip moved."""
        recent = [r for r in self._readings if r.time_ns >= now_ns - WINDOW_NS]
        return register_straight([r.position for r in recent], [r.orientation for r in recent])


def save_registration(path: str | Path, registration: StraightRegistration) -> None:
    """Keep a registration in a YAML file."""
    content = {
        'registered': datetime.datetime.now(datetime.UTC).isoformat(timespec='seconds'),
        'position': list(registration.position),
        'orientation': list(registration.orientation),
    }
    write_text(path, yaml.safe_dump(content, sort_keys=False))


def load_registration(path: str | Path) -> StraightRegistration:
    """Read what :func:`save_registration` wrote; FileError where that cannot be read."""
    what = 'registration'
    file = load(_Registration, path, what)
    norm = math.hypot(*file.orientation)
    if not 0.0 < norm < math.inf:
        raise FileError(
            f'{what} {path}: orientation {list(file.orientation)} is not an orientation'
        )
    x, y, z, w = (v / norm for v in file.orientation)
    return StraightRegistration(file.position, (x, y, z, w))


@dataclass(frozen=True)
class _Registration:
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]
    registered: Any = None

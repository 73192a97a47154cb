"""Interfaces of devices: servos in position mode, and sensors that are read by a thread."""

import threading
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from endoscope_core.errors import EndoscopeError
from endoscope_core.rig import Kind

_SILENT_NS = 250_000_000


class DeviceError(EndoscopeError, RuntimeError):
    """A device cannot be opened or is set up wrongly; the message says what to do."""


@dataclass(frozen=True)
class MotorReading:
    """Newest valid state of J motor shafts."""

    position: tuple[float, ...]  # rad, (J,)
    velocity: tuple[float, ...]  # rad/s, (J,)
    effort: tuple[float, ...]  # N m, (J,)
    age: float = 0.0  # s since it was measured


class MotorDevice(Protocol):
    """Servos in position mode, as a thread runs a real bus: no call waits."""

    names: tuple[str, ...]

    @property
    def kind(self) -> Kind:
        """What the servos are, once they have been opened."""

    def open(self) -> None:
        """Connect and check the settings; DeviceError where not reachable, or set up wrongly."""

    def set_torque(self, on: bool) -> None:
        """Let the servos hold and then follow goals, or switch them off; ends an error."""

    def exchange(self, goal: Sequence[float], periods: int) -> MotorReading | None:
        """Renew the goal (J,) in rad after `periods` of 1 ms; the newest reading, if it is new."""

    def trouble(self) -> str:
        """The error that prevents motion, empty if none; called in every tick."""

    def health(self) -> dict[str, object]:
        """Figures for diagnostics."""

    def close(self) -> None:
        """Release the device."""


class ReadingThread[Reading](ABC):
    """Reads from `open` to `close` into a queue of `kept` readings; taking them never waits."""

    def __init__(self, name: str, kept: int) -> None:
        self._readings: deque[Reading] = deque(maxlen=kept)
        self._counts: Counter[str] = Counter()
        self._good_ns: int | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def open(self) -> None:
        """Start to read; a device that is not there yet is waited for."""
        self._thread.start()

    def take(self) -> list[Reading]:
        """Readings since the last call, oldest first; never waits for the device."""
        taken = []
        while self._readings:
            taken.append(self._readings.popleft())
        return taken

    def close(self) -> None:
        """Stop reading and release the device."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    @abstractmethod
    def _run(self) -> None:
        """Read until `_stop` is set."""

    def _keep(self, reading: Reading, asked_ns: int) -> None:
        """Queue a good reading that was requested at `asked_ns` of ``time.monotonic_ns``."""
        self._counts['readings'] += 1
        self._good_ns = asked_ns
        self._readings.append(reading)

    def _age_ns(self) -> int | None:
        good = self._good_ns
        return None if good is None else time.monotonic_ns() - good

    def _silent(self) -> bool:
        age = self._age_ns()
        return age is None or age > _SILENT_NS

    def _age_figure(self) -> dict[str, object]:
        age = self._age_ns()
        return {'age of the last reading [ms]': 'never' if age is None else round(age * 1e-6, 1)}

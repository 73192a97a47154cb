"""A sensor that a thread of its own reads, and what was read until somebody takes it."""

import threading
import time
from abc import ABC, abstractmethod
from collections import Counter, deque

_SILENT_NS = 250_000_000


class ReadingThread[Reading](ABC):
    """Reads from `open` to `close`; nobody who takes the readings waits for the device.

    `name`: of the thread.
    `kept`: so many readings wait at most; the oldest gives way to the newest.
    """

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
        """Stop reading and let go of the device."""
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()

    @abstractmethod
    def _run(self) -> None:
        """Read until `_stop` is set."""

    def _keep(self, reading: Reading, asked_ns: int) -> None:
        """Let a good reading be taken that was asked for at `asked_ns` of ``time.monotonic_ns``."""
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

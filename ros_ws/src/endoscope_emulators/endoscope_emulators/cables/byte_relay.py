"""Relays bytes between two file descriptors, with faults chosen by a test."""

import heapq
import os
import select
import threading
import time
from collections.abc import Callable, Sequence

# What happens to bytes: pieces, each with its delay in s. Nothing overtakes.
Tap = Callable[[bytes], Sequence[tuple[float, bytes]]]

_CHUNK = 4096


def faithful(data: bytes) -> Sequence[tuple[float, bytes]]:
    """Let everything through at once."""
    return [(0.0, data)]


class ByteRelay:
    """A thread between two file descriptors, closed by the caller; it ends when either goes away.

    `tap_for` gives the tap in force at an end from which bytes come, ``'near'`` or ``'far'``.
    """

    def __init__(self, near: int, far: int, tap_for: Callable[[str], Tap]) -> None:
        self._ends = {'near': near, 'far': far}
        self._tap_for = tap_for
        self._due: list[tuple[float, int, int, bytes]] = []
        self._order = 0
        self._latest = {near: 0.0, far: 0.0}
        self._wake_read, self._wake_write = os.pipe()
        self._thread = threading.Thread(target=self._run, name='relay', daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop carrying."""
        os.write(self._wake_write, b'x')
        self._thread.join()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def _run(self) -> None:
        while self._carry():
            pass

    def _carry(self) -> bool:
        timeout = max(0.0, self._due[0][0] - time.monotonic()) if self._due else None
        ready, _, _ = select.select([*self._ends.values(), self._wake_read], [], [], timeout)
        if self._wake_read in ready:
            return False
        try:
            for name, other in (('near', 'far'), ('far', 'near')):
                if self._ends[name] in ready:
                    data = os.read(self._ends[name], _CHUNK)
                    if not data:
                        return False
                    self._take(self._tap_for(name)(data), self._ends[other])
            while self._due and self._due[0][0] <= time.monotonic():
                _, _, end, data = heapq.heappop(self._due)
                os.write(end, data)
        except OSError:
            # An end was closed or hung up: that is how an unplugged cable looks from here.
            return False
        return True

    def _take(self, pieces: Sequence[tuple[float, bytes]], end: int) -> None:
        now = time.monotonic()
        for delay, data in pieces:
            self._order += 1
            self._latest[end] = max(self._latest[end], now + delay)
            heapq.heappush(self._due, (self._latest[end], self._order, end, data))

"""SIGINT and SIGTERM as a request to stop, seen at once and never in the middle of a callback."""

import signal
import socket
import threading
from collections.abc import Callable
from types import FrameType, TracebackType
from typing import Self

_STOPPING = (signal.SIGINT, signal.SIGTERM)


class StopSignals:
    """Calls ``on_stop`` from a thread of its own when the process is asked to stop.

    An exception raised by a signal handler would tear a callback apart, and rclpy's own handler
    shuts the context down under callbacks that are publishing, so that a node could neither finish
    its work nor say that it ends.  A second signal raises KeyboardInterrupt, for a process
    that does not stop.

    Parameters
    ----------
    on_stop
        Must be safe to call from another thread.
    """

    def __init__(self, on_stop: Callable[[], None]) -> None:
        self._on_stop = on_stop
        self._asked = False

    def __enter__(self) -> Self:
        self._reader, self._writer = socket.socketpair()
        self._writer.setblocking(False)
        self._former_handlers = {s: signal.signal(s, self._handle) for s in _STOPPING}
        self._former_fd = signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._watch, name='stop_signals', daemon=True)
        self._thread.start()
        return self

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if self._asked:
            raise KeyboardInterrupt
        self._asked = True

    def _watch(self) -> None:
        # Python runs handlers between byte codes only, which a quiet executor never reaches; the
        # interpreter writes the signal's number to this socket at once.
        while data := self._reader.recv(16):
            if any(number in data for number in _STOPPING):
                self._on_stop()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        signal.set_wakeup_fd(self._former_fd)
        for number, handler in self._former_handlers.items():
            signal.signal(number, handler)
        self._writer.close()
        self._thread.join()
        self._reader.close()

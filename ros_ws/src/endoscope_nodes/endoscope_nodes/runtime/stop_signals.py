"""SIGINT, SIGTERM and SIGHUP as a request to stop, seen at once and never within a callback."""

import os
import signal
import socket
import threading
from collections.abc import Callable
from types import FrameType
from typing import Self

_WORDS = {
    signal.SIGINT: 'interrupted',
    signal.SIGTERM: 'terminated',
    signal.SIGHUP: 'hung up',
}


def _stopping() -> tuple[signal.Signals, ...]:
    # Whoever starts a program by `nohup` wants it to outlive the terminal.
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    return tuple(s for s in _WORDS if not (s == signal.SIGHUP and ignored))


def end_when_asked(program: str) -> None:
    """End the process at a signal, with one line and status 128 + number, from now on."""

    def end(number: int, frame: FrameType | None) -> None:
        os.write(2, f'{program}: {_WORDS[signal.Signals(number)]} while starting\n'.encode())
        # A program that is still starting has opened nothing, and an exception out of a handler
        # would be raised wherever the imports are, some of which turn it into another one or lose
        # it.
        os._exit(128 + number)

    for number in _stopping():
        signal.signal(number, end)


class StopSignals:
    """Calls `on_stop` from a thread of its own when the process is asked to stop.

    An exception raised by a signal handler would tear a callback apart, and rclpy's own handler
    shuts the context down under callbacks that are publishing, so that a node could neither finish
    its work nor say that it ends. Further signals change nothing: whatever is being finished is
    finished, and only SIGKILL ends a process that hangs.
    """

    def __init__(self, on_stop: Callable[[], None]) -> None:
        self.on_stop = on_stop  # at the first signal, from another thread
        self._asked = False

    def __enter__(self) -> Self:
        self._reader, self._writer = socket.socketpair()
        self._writer.setblocking(False)
        self._former_handlers = {s: signal.signal(s, self._handle) for s in _stopping()}
        self._former_fd = signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        self._thread = threading.Thread(target=self._watch, name='stop_signals', daemon=True)
        self._thread.start()
        return self

    def _handle(self, number: int, frame: FrameType | None) -> None:
        """Leave it to the thread."""

    def _watch(self) -> None:
        # Python runs handlers between byte codes only, which a quiet executor never reaches; the
        # interpreter writes the signal's number to this socket at once.
        while data := self._reader.recv(16):
            if not self._asked and any(number in data for number in self._former_handlers):
                self._asked = True
                self.on_stop()

    def __exit__(self, *_: object) -> None:
        signal.set_wakeup_fd(self._former_fd)
        for number, handler in self._former_handlers.items():
            # A process that was asked to stop is about to end; asked again it need not hurry.
            signal.signal(number, signal.SIG_IGN if self._asked else handler)
        self._writer.close()
        self._thread.join()
        self._reader.close()

"""A terminal whose keys are read one by one, and which is put back as it was found."""

import contextlib
import os
import select
import shutil
import sys
import termios
import time

from endoscope_bringup.teleop.terminal_keys import (
    ASK_FOR_EVENTS,
    ASK_FOR_FOCUS,
    ASK_WHETHER,
    END_EVENTS,
    END_FOCUS,
    KeyEvent,
    TerminalKeys,
)
from endoscope_core.closed_on_exit import ClosedOnExit
from endoscope_core.errors import EndoscopeError

_ANSWERED_S = 0.3
_ESCAPE_S = 0.05
_LOCAL, _INPUT, _CONTROL_CHARACTERS = 3, 0, 6
_CLEAR_BELOW = '\r\x1b[J'
_UP = '\r\x1b[A'


class NoTerminalError(EndoscopeError):
    """There is none on stdin or stdout."""


class TerminalLostError(Exception):
    """It was closed, or hung up."""


def check_terminal() -> None:
    """Refuse to go on without a terminal at both stdin and stdout."""
    for stream, name in ((sys.stdin, 'stdin'), (sys.stdout, 'stdout')):
        if not stream.isatty():
            raise NoTerminalError(
                f'teleop needs a terminal, and {name} is none: a held key is its dead-man'
            )


class Terminal(ClosedOnExit):
    """Stdin without lines and echo, and two lines of stdout that are written again and again.

    Signals of keys stay on: Ctrl-C interrupts even where this program hangs.
    """

    def __init__(self) -> None:
        self._in, self._out = sys.stdin.fileno(), sys.stdout.fileno()
        self._before: list | None = None
        self._begun_s: float | None = None
        self._keys = TerminalKeys()
        self.told_apart = False  # it tells presses and releases apart

    def open(self) -> None:
        """Take the terminal over, and ask it what it can do; TerminalLostError if it is gone."""
        try:
            self._before = termios.tcgetattr(self._in)
            self._read_keys()
        except termios.error as error:
            raise TerminalLostError(str(error)) from error
        self._keys = TerminalKeys()
        self._write(ASK_WHETHER.decode())
        end = time.monotonic() + _ANSWERED_S
        while self._keys.told_apart is None and (left := end - time.monotonic()) > 0.0:
            select.select([self._in], [], [], left)
            self.read()
        # An answer that comes later changes nothing any more.
        self.told_apart = bool(self._keys.told_apart)
        if self.told_apart:
            self._write(ASK_FOR_EVENTS.decode())
        self._write(ASK_FOR_FOCUS.decode())

    def _read_keys(self) -> None:
        """Have single keys instead of lines, without echo."""
        ours = termios.tcgetattr(self._in)
        ours[_LOCAL] &= ~(termios.ICANON | termios.ECHO | termios.IEXTEN)
        # Ctrl-S would stop the output, and with it this program.
        ours[_INPUT] &= ~(termios.IXON | termios.ICRNL)
        ours[_CONTROL_CHARACTERS][termios.VMIN] = 1
        ours[_CONTROL_CHARACTERS][termios.VTIME] = 0
        termios.tcsetattr(self._in, termios.TCSAFLUSH, ours)

    def read(self) -> list[KeyEvent]:
        """Take the key events that have come; TerminalLostError if the terminal is gone."""
        events: list[KeyEvent] = []
        while select.select([self._in], [], [], 0.0)[0]:
            try:
                data = os.read(self._in, 1024)
            except OSError as error:
                raise TerminalLostError(str(error)) from error
            if not data:
                raise TerminalLostError('end of input')
            events += self._keys.read(data)
            self._begun_s = time.monotonic()
        if self._keys.waiting and self._begun_s and time.monotonic() - self._begun_s > _ESCAPE_S:
            events += self._keys.flush()
        return events

    def show(self, first: str, second: str) -> None:
        """Write the two lines anew, cut to the width; not at all while the terminal is stuck."""
        width = shutil.get_terminal_size().columns - 1
        self._write(f'{_CLEAR_BELOW}{first[:width]}\r\n{second[:width]}{_UP}')

    def say(self, text: str) -> None:
        """Write text above the two lines."""
        self._write(_CLEAR_BELOW + text.replace('\n', '\r\n') + '\r\n')

    def _write(self, text: str) -> None:
        # A stuck or lost terminal must not hold up whoever has the clutch.
        with contextlib.suppress(OSError):
            if select.select([], [self._out], [], 0.0)[1]:
                os.write(self._out, text.encode())

    def close(self) -> None:
        """Put the terminal back as it was found."""
        if self._before is None:
            return
        before, self._before = self._before, None
        if self.told_apart:
            self._write(END_EVENTS.decode())
        self._write(END_FOCUS.decode() + _CLEAR_BELOW)
        # Repeats that are still to be read are not for the shell. A terminal that is lost has no
        # settings left to restore.
        with contextlib.suppress(termios.error):
            termios.tcflush(self._in, termios.TCIFLUSH)
            termios.tcsetattr(self._in, termios.TCSANOW, before)

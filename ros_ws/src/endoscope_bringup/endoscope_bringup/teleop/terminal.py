"""A terminal whose keys are read one by one, and which is put back as it was found.

It sends a key's character or sequence when the key is pressed and again at each repeat (ECMA-48,
xterm control sequences), and nothing when it is released.
"""

import codecs
import contextlib
import os
import re
import select
import sys
import termios
import time

from endoscope_core.errors import EndoscopeError
from endoscope_core.exit_status import ClosedOnExit

_ARROWS = {'A': 'up', 'B': 'down', 'C': 'right', 'D': 'left'}
_KEY = re.compile('\x1b(?:\\[([0-9;]*)[ -/]*([@-~])|O([ -~]))|\x1b|[^\x1b]', re.DOTALL)
_BEGUN = re.compile('\x1b(?:\\[[0-9;]{0,60}[ -/]*|O)?')
_ESCAPE_S = 0.05
_LOCAL, _INPUT, _CONTROL_CHARACTERS = 3, 0, 6


class TerminalKeys:
    """Reads names of keys out of the bytes of a terminal, however they are cut."""

    # A name is the character in lower case, ``up``, ``down``, ``left``, ``right``, or ``other``.

    def __init__(self) -> None:
        self._text = codecs.getincrementaldecoder('utf-8')('replace')
        self._begun = ''

    @property
    def waiting(self) -> bool:
        """Whether a sequence has begun that has not ended yet."""
        return bool(self._begun)

    def read(self, data: bytes) -> list[str]:
        """Take bytes as they come."""
        text, self._begun = self._begun + self._text.decode(data), ''
        keys = []
        for found in _KEY.finditer(text):
            if found[0] == '\x1b' and _BEGUN.fullmatch(text, found.start()):
                self._begun = text[found.start() :]
                break
            keys.append(_name(found))
        return keys

    def flush(self) -> list[str]:
        """Take a sequence that does not go on for another key."""
        begun, self._begun = self._begun, ''
        return ['other'] if begun else []


def _name(found: re.Match[str]) -> str:
    parameters, final, single = found.groups()
    if final or single:
        return _ARROWS.get(final or single, 'other') if not parameters else 'other'
    character = found[0]
    return character.lower() if character.isprintable() else 'other'


class TerminalLostError(Exception):
    """It was closed, or hung up."""


def check_terminal() -> None:
    """Refuse to go on without a terminal at both stdin and stdout."""
    for stream, name in ((sys.stdin, 'stdin'), (sys.stdout, 'stdout')):
        if not stream.isatty():
            raise EndoscopeError(
                f'teleop needs a terminal, and {name} is not one: a held key is its dead-man'
            )


class Terminal(ClosedOnExit):
    """Stdin without lines and echo; signals of keys stay on: Ctrl-C interrupts whatever hangs."""

    def __init__(self) -> None:
        self._in, self._out = sys.stdin.fileno(), sys.stdout.fileno()
        self._before: list | None = None
        self._begun_s = 0.0
        self._keys = TerminalKeys()

    def open(self) -> None:
        """Have single keys instead of lines, without echo; TerminalLostError if it is gone."""
        try:
            self._before, ours = termios.tcgetattr(self._in), termios.tcgetattr(self._in)
            ours[_LOCAL] &= ~(termios.ICANON | termios.ECHO | termios.IEXTEN)
            # Ctrl-S would stop the output, and with it this program.
            ours[_INPUT] &= ~(termios.IXON | termios.ICRNL)
            ours[_CONTROL_CHARACTERS][termios.VMIN] = 1
            ours[_CONTROL_CHARACTERS][termios.VTIME] = 0
            termios.tcsetattr(self._in, termios.TCSAFLUSH, ours)
        except termios.error as error:
            raise TerminalLostError(str(error)) from error

    def read(self) -> list[str]:
        """Take the keys that have come; TerminalLostError if the terminal is gone."""
        keys: list[str] = []
        while select.select([self._in], [], [], 0.0)[0]:
            try:
                data = os.read(self._in, 1024)
            except OSError as error:
                raise TerminalLostError(str(error)) from error
            if not data:
                raise TerminalLostError('end of input')
            keys += self._keys.read(data)
            self._begun_s = time.monotonic()
        if self._keys.waiting and time.monotonic() - self._begun_s > _ESCAPE_S:
            keys += self._keys.flush()
        return keys

    def say(self, text: str) -> None:
        """Write a line; a stuck or lost terminal must not block the release of the clutch."""
        with contextlib.suppress(OSError):
            if select.select([], [self._out], [], 0.0)[1]:
                os.write(self._out, f'{text}\n'.encode())

    def close(self) -> None:
        """Put the terminal back as it was found."""
        if self._before is None:
            return
        before, self._before = self._before, None
        # Repeats that are still to be read are not for the shell. A terminal that is lost has no
        # settings left to restore.
        with contextlib.suppress(termios.error):
            termios.tcflush(self._in, termios.TCIFLUSH)
            termios.tcsetattr(self._in, termios.TCSANOW, before)

"""A terminal whose keys are read one by one, and which is put back as it was found.

A terminal by itself sends a key's character or sequence when it is pressed and again at each
repeat (ECMA-48, xterm control sequences); one that speaks the keyboard protocol of kitty also tells
presses, repeats and releases apart (https://sw.kovidgoyal.net/kitty/keyboard-protocol/).
"""

import codecs
import contextlib
import os
import re
import select
import shutil
import sys
import termios
import time
from dataclasses import dataclass
from enum import StrEnum

from endoscope_core.errors import EndoscopeError
from endoscope_core.exit_status import ClosedOnExit

# Which keys' events to report: escapes told apart (1), presses, repeats and releases (2), all (8).
ASK_FOR_EVENTS = b'\x1b[>11u'
END_EVENTS = b'\x1b[<u'
# Which of these are in force, and then what every terminal answers: what it is.
ASK_WHETHER = b'\x1b[?u\x1b[c'
ASK_FOR_FOCUS = b'\x1b[?1004h'
END_FOCUS = b'\x1b[?1004l'

FOCUS_LOST = 'focus lost'

_ESC = 0x1B
_ARROWS = {'A': 'up', 'B': 'down', 'C': 'right', 'D': 'left'}
_NAMED = {27: 'escape', 13: 'enter', 9: 'tab', 127: 'backspace', 57412: '-', 57413: '='}
_NAMED |= {57417: 'left', 57418: 'right', 57419: 'up', 57420: 'down'}
# Shift is one of the ways to a character; caps lock and num lock mean nothing here.
_OF_NO_ACCOUNT = 0b11000001
_CONTROL = 0b100
_SEQUENCE = re.compile(rb'\x1b(?:\[([0-9:;<=>?]*)[ -/]*([@-~])|O([ -~]))')
_BEGUN = re.compile(rb'\x1b(?:\[[0-9:;<=>?]*[ -/]*|O)?')
_LONGEST = 64
_ANSWERED_S = 0.3
_ESCAPE_S = 0.05
_LOCAL, _INPUT, _CONTROL_CHARACTERS = 3, 0, 6
_CLEAR_BELOW = '\r\x1b[J'
_UP = '\r\x1b[A'


class KeyEventKind(StrEnum):
    """What happened to a key."""

    PRESS = 'press'
    REPEAT = 'repeat'
    RELEASE = 'release'


_KINDS = {'1': KeyEventKind.PRESS, '2': KeyEventKind.REPEAT, '3': KeyEventKind.RELEASE}


@dataclass(frozen=True)
class KeyEvent:
    """One event of a key."""

    # The character, in lower case; ``up``, ``down``, ``left``, ``right``, ``escape``, ``ctrl+c``
    # and so on; `FOCUS_LOST` where the keyboard went to another window; ``other``.
    key: str
    # A terminal without the protocol of kitty calls everything a press.
    kind: KeyEventKind = KeyEventKind.PRESS


class TerminalKeys:
    """Reads key events out of the bytes of a terminal."""

    def __init__(self) -> None:
        # Whether the terminal has said that it tells presses and releases apart; None while it has
        # not answered.
        self.told_apart: bool | None = None
        self._bytes = b''

    @property
    def waiting(self) -> bool:
        """Whether a sequence has begun that has not ended yet."""
        return bool(self._bytes)

    def read(self, data: bytes) -> list[KeyEvent]:
        """Take bytes as they come, however they are cut."""
        text, self._bytes = self._bytes + data, b''
        events: list[KeyEvent] = []
        while text:
            if text[0] == _ESC:
                found = _SEQUENCE.match(text)
                if found:
                    text = text[found.end() :]
                    events += self._sequence(found)
                    continue
                begun = _BEGUN.match(text)
                if begun and begun.end() == len(text) and len(text) < _LONGEST:
                    self._bytes = text
                    break
                events.append(KeyEvent('escape'))
                text = text[1:]
                continue
            event, length = _character(text)
            if not length:
                self._bytes = text
                break
            events.append(event)
            text = text[length:]
        return events

    def flush(self) -> list[KeyEvent]:
        """Take a sequence that does not go on for the key Esc, half a character for another key."""
        rest, self._bytes = self._bytes, b''
        return [KeyEvent('escape' if rest[0] == _ESC else 'other')] if rest else []

    def _sequence(self, found: re.Match[bytes]) -> list[KeyEvent]:
        body, final, single = (part.decode() if part else '' for part in found.groups())
        if single:
            return [KeyEvent(_ARROWS.get(single, 'other'))]
        if body.startswith('?'):
            # Not a key but an answer; a terminal that does not know the first question says only
            # what it is.
            if final == 'u':
                self.told_apart = True
            elif final == 'c' and self.told_apart is None:
                self.told_apart = False
            return []
        if final == 'I' and not body:
            return []
        if final == 'O' and not body:
            return [KeyEvent(FOCUS_LOST)]
        code, modifiers, kind = _parameters(body)
        of_code = final == 'u'
        key = _NAMED.get(code) or _printable(code) if of_code else _ARROWS.get(final, 'other')
        modifiers &= ~_OF_NO_ACCOUNT
        if modifiers == _CONTROL:
            key = f'ctrl+{key}'
        elif modifiers:
            key = 'other'
        return [KeyEvent(key, kind)]


def _parameters(body: str) -> tuple[int, int, KeyEventKind]:
    """Key code, modifiers and kind out of ``code:alternates;modifiers:kind;text``."""
    fields = body.split(';')
    code = fields[0].partition(':')[0]
    modifiers, _, kind = (fields[1] if len(fields) > 1 else '').partition(':')
    number = int(modifiers) - 1 if modifiers.isdigit() else 0
    return (
        int(code) if code.isdigit() else 1,
        max(0, number),
        _KINDS.get(kind, KeyEventKind.PRESS),
    )


def _printable(code: int) -> str:
    character = chr(code) if code < 0xE000 else ''
    return character.lower() if character.isprintable() and character else 'other'


def _character(text: bytes) -> tuple[KeyEvent, int]:
    """Read the character that a text begins with, and its length: none while bytes are missing.

    What is no character is another key.
    """
    first = text[0]
    length = 1 if first < 0xC0 else 2 if first < 0xE0 else 3 if first < 0xF0 else 4
    try:
        character, length = codecs.utf_8_decode(text[:length])
    except UnicodeDecodeError:
        return KeyEvent('other'), 1
    if not length:
        return KeyEvent('other'), 0
    if first < 0x20 and first not in _NAMED:
        return KeyEvent(f'ctrl+{chr(first + 0x60)}'), 1
    return KeyEvent(_NAMED.get(first) or _printable(ord(character))), length


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
        """Redraw the two lines, cut to the width; not at all while the terminal is stuck."""
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

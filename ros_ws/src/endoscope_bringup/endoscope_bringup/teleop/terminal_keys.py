"""What a terminal sends when keys are pressed: bytes in, key events out.

A terminal by itself sends a key's character or sequence when it is pressed and again at each
repeat (ECMA-48, xterm control sequences); one that speaks the keyboard protocol of kitty also tells
presses, repeats and releases apart (https://sw.kovidgoyal.net/kitty/keyboard-protocol/).
"""

import codecs
import re
from dataclasses import dataclass
from enum import StrEnum

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


class KeyEventKind(StrEnum):
    """What happened to a key."""

    PRESS = 'press'
    REPEAT = 'repeat'
    RELEASE = 'release'


_KINDS = {'1': KeyEventKind.PRESS, '2': KeyEventKind.REPEAT, '3': KeyEventKind.RELEASE}


@dataclass(frozen=True)
class KeyEvent:
    """One event of a key.

    Attributes
    ----------
    key
        The character, in lower case; ``up``, ``down``, ``left``, ``right``, ``escape``, ``ctrl+c``
        and so on; `FOCUS_LOST` where the keyboard went to another window; ``other``.
    kind
        A terminal without the protocol of kitty calls everything a press.
    """

    key: str
    kind: KeyEventKind = KeyEventKind.PRESS


class TerminalKeys:
    """Reads key events out of the bytes of a terminal.

    Attributes
    ----------
    told_apart
        Whether the terminal has said that it tells presses and releases apart; None while it has
        not answered.
    """

    def __init__(self) -> None:
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

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from endoscope_bringup.teleop.terminal import FOCUS_LOST, KeyEvent, KeyEventKind, TerminalKeys

PRESS, REPEAT, RELEASE = KeyEventKind


@pytest.mark.parametrize(
    ('sent', 'key'),
    [
        (b'\x1b[A', 'up'),
        (b'\x1bOD', 'left'),
        (b'w', 'w'),
        (b'W', 'w'),
        (b' ', ' '),
        (b'\x03', 'ctrl+c'),
        (b'\x1a', 'ctrl+z'),
        (b'\r', 'enter'),
        (b'\x7f', 'backspace'),
        ('é'.encode(), 'é'),
        (b'\xff', 'other'),
        (b'\x1b[3~', 'other'),
        (b'\x1b[1;5C', 'ctrl+right'),
        (b'\x1b[O', FOCUS_LOST),
        (b'\x1b[119u', 'w'),
        (b'\x1b[61;2u', '='),
        (b'\x1b[99;5u', 'ctrl+c'),
        (b'\x1b[57441;2u', 'other'),
        (b'\x1b[97;3u', 'other'),
        (b'\x1b[97;65u', 'a'),
    ],
)
def test_each_key_is_one_press(sent, key):
    assert TerminalKeys().read(sent) == [KeyEvent(key)]


@pytest.mark.parametrize(
    ('sent', 'event'),
    [
        (b'\x1b[119;1:1u', KeyEvent('w', PRESS)),
        (b'\x1b[119;1:2u', KeyEvent('w', REPEAT)),
        (b'\x1b[119;1:3u', KeyEvent('w', RELEASE)),
        (b'\x1b[1;1:3A', KeyEvent('up', RELEASE)),
        (b'\x1b[119:87:119;2:2;87u', KeyEvent('w', REPEAT)),
    ],
)
def test_a_terminal_with_the_protocol_of_kitty_tells_them_apart(sent, event):
    assert TerminalKeys().read(sent) == [event]


def test_a_terminal_says_by_its_answer_whether_it_has_the_protocol():
    for answer, told_apart in ((b'\x1b[?0u\x1b[?62;c', True), (b'\x1b[?62;c', False)):
        keys = TerminalKeys()
        assert keys.told_apart is None
        assert keys.read(answer) == []
        assert keys.told_apart is told_apart


def test_an_escape_that_leads_nowhere_is_the_key_esc():
    keys = TerminalKeys()
    assert keys.read(b'\x1b') == []
    assert keys.waiting
    assert keys.flush() == [KeyEvent('escape')]
    assert keys.flush() == []


@given(st.binary(max_size=80), st.integers(0, 80))
@example(b'\x00\xc2\x80', 2)
@example('\N{EURO SIGN}'.encode() * 2, 4)
def test_it_makes_no_difference_how_bytes_are_cut(data, cut):
    whole, parts = TerminalKeys(), TerminalKeys()
    expected = whole.read(data) + whole.flush()
    assert parts.read(data[:cut]) + parts.read(data[cut:]) + parts.flush() == expected


@given(st.binary(max_size=200))
def test_any_bytes_can_be_read(data):
    keys = TerminalKeys()
    for event in keys.read(data):
        assert event.key

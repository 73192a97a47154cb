import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from endoscope_bringup.teleop.terminal import TerminalKeys


@pytest.mark.parametrize(
    ('sent', 'keys'),
    [
        (b'\x1b[A', ['up']),
        (b'\x1bOD', ['left']),
        (b'wW \xc3\xa9', ['w', 'w', ' ', 'é']),
        (b'\r\x7f\x03', ['other'] * 3),
        (b'\x1b[3~', ['other']),
        (b'\x1b[1;5C', ['other']),
        (b'\x1b\x1b[B', ['other', 'down']),
        (b'\x1bw', ['other', 'w']),
    ],
)
def test_keys_have_names(sent, keys):
    assert TerminalKeys().read(sent) == keys


def test_an_escape_that_leads_nowhere_is_another_key():
    keys = TerminalKeys()
    assert keys.read(b'\x1b') == []
    assert keys.waiting
    assert keys.flush() == ['other']
    assert keys.flush() == []


@given(st.binary(max_size=80), st.integers(0, 80))
@example(b'\x1b[A', 1)
@example('\N{EURO SIGN}'.encode() * 2, 4)
def test_it_makes_no_difference_how_bytes_are_cut(data, cut):
    whole, parts = TerminalKeys(), TerminalKeys()
    expected = whole.read(data) + whole.flush()
    assert parts.read(data[:cut]) + parts.read(data[cut:]) + parts.flush() == expected
    assert all(expected)

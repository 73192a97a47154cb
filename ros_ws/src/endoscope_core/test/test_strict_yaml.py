"""YAML from elsewhere: what is ambiguous or boundless is refused by its line."""

import string

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.errors import EndoscopeError, FileError, printable
from endoscope_core.schema import DEEPEST, LARGEST, load_yaml, parse_yaml

plain = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**40), 10**40)
    | st.floats(allow_nan=False)
    | st.text(string.printable),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=10,
)


@given(plain)
def test_what_is_written_plainly_is_read_as_it_is(content):
    assert parse_yaml(yaml.safe_dump(content), 'text') == content


@pytest.mark.parametrize(
    ('text', 'what'),
    [
        ('a: 1\nb: 2\na: 3\n', "line 3: key 'a' is given twice"),
        ('a: {b: 1,\n b: 2}', "line 2: key 'b' is given twice"),
        ('a: &x [1]\nb: *x', r'line 2: \*x refers to another place'),
        ('a: 1\n<<: {b: 2}', 'line 2: a merge key'),
        ('a: !!python/object/apply:os.system [true]', 'line 1: a type is given'),
        ('a:\n  ' + '[' * 5000, 'line 2: nested deeper than 16 levels'),
        ('a: 1\nb: ' + '9' * 5000, 'line 2: a number of 5000 characters'),
        ('a: ' + '1:' * 2000 + '1', 'a number of 4001 characters'),
        ('a: 2026-13-01', 'line 1: month must be in 1..12'),
        ('? [1]\n: 2', 'a list or mapping as a key'),
        ('a: [', 'line 2'),
        ('a: \x1b', 'not YAML'),
        ('a: 1\n---\nb: 2', 'another document'),
        ('a: ' + 'x' * LARGEST, 'larger than 1 MiB'),
    ],
)
def test_what_is_wrong_is_named_by_its_line(tmp_path, text, what):
    path = tmp_path / 'file.yaml'
    path.write_text(text)
    with pytest.raises(FileError, match=what) as caught:
        load_yaml(path)
    assert str(path) in str(caught.value)
    assert str(caught.value).isprintable()


def test_depth_is_counted_from_the_top():
    assert parse_yaml('[' * DEEPEST + ']' * DEEPEST, 'text') is not None
    with pytest.raises(FileError, match='nested'):
        parse_yaml('[' * (DEEPEST + 1) + ']' * (DEEPEST + 1), 'text')


def test_a_file_that_is_not_there_or_no_text_is_one_line(tmp_path):
    with pytest.raises(FileError, match=r'cannot read .*none'):
        load_yaml(tmp_path / 'none')
    (tmp_path / 'bytes').write_bytes(b'a: \xff')
    with pytest.raises(FileError, match='invalid start byte at byte 3'):
        load_yaml(tmp_path / 'bytes')


@given(st.text())
def test_no_text_steers_a_terminal(text):
    shown = printable(text)
    assert shown.isprintable()
    assert str(EndoscopeError(text)).isprintable()
    assert (shown == text) == text.isprintable()


def test_an_error_is_one_line_of_bounded_length():
    assert str(EndoscopeError('/a\x1b[2J\nb')) == r'/a\x1b[2J b'
    assert len(str(EndoscopeError('x' * 10**6))) < 2100

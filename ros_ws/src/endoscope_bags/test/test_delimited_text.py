"""Tables as loggers and spreadsheets write them."""

import re
import shlex
import subprocess
from dataclasses import fields

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_bags.delimited_text import date_ns, described_table, read_table
from endoscope_bags.errors import BagError
from endoscope_bags.table_mapping import EXAMPLE, TableMapping, load_table_mapping
from endoscope_bags.text_table import convert_table
from endoscope_core.errors import FileError

ROWS = [(0.0, 10.0, -1.5), (0.01, 11.0, -1.25), (0.02, 12.0, -1.0), (0.03, 13.5, 0.5)]


def table(path, text, encoding='utf-8'):
    path.write_bytes(text.encode(encoding))
    return path


def lines(separator, comma=False, rows=ROWS):
    text = '\n'.join(separator.join(str(number) for number in row) for row in rows)
    return text.replace('.', ',') if comma else text


def mapped(tmp_path, text, mapping):
    (tmp_path / 'm.yaml').write_text(mapping)
    done = convert_table(
        table(tmp_path / 't.csv', text), load_table_mapping(tmp_path / 'm.yaml'), tmp_path / 'bag'
    )
    return done, open_bag(tmp_path / 'bag')


@pytest.mark.parametrize(
    ('newline', 'encoding'), [('\n', 'utf-8'), ('\r\n', 'utf-8-sig'), ('\r', 'utf-16')]
)
@pytest.mark.parametrize(
    ('separator', 'comma'),
    [(',', False), (';', False), (';', True), ('\t', False), ('\t', True), ('  ', False)],
)
@pytest.mark.parametrize(
    ('above', 'header_lines'),
    [
        ([], None),
        (['time|angle|force'], None),
        (['# time|angle|force'], None),
        (['% rig 4, tube 2', '%', '% time|angle|force'], 3),
        (['Rig 4', 'sampling rate|1000', '', 'time|angle|force'], 4),
    ],
)
def test_the_separator_and_the_line_of_names_are_found(
    tmp_path, separator, comma, above, header_lines, encoding, newline
):
    head = ''.join(line.replace('|', separator) + '\n' for line in above)
    text = (head + lines(separator, comma) + '\n').replace('\n', newline)
    read = read_table(
        table(tmp_path / 't.csv', text, encoding), header_lines=header_lines, decimal_comma=comma
    )
    values = np.stack([read.numbers(k)[0] for k in range(3)], axis=1)
    assert values.tolist() == [list(row) for row in ROWS]
    assert read.titles == (('time', 'angle', 'force') if above else ())


def test_an_encoding_that_is_not_read_is_named_with_what_to_do(tmp_path):
    path = table(tmp_path / 't.csv', 't,q\n0,1\n1,90\xb0\n', 'latin-1')
    with pytest.raises(BagError, match=r'line 3: byte 0xb0 is not utf-8; .*Latin-1') as caught:
        read_table(path)
    [command] = re.findall('iconv .*', str(caught.value))
    subprocess.run(shlex.split(command), cwd=tmp_path, check=True)
    assert read_table(tmp_path / 'utf8.csv').cells(1) == ['1', '90\xb0']


def test_quoted_cells_may_hold_the_separator(tmp_path):
    read = read_table(table(tmp_path / 't.csv', '"time, s","angle"\n"0","1"\n"1","2"\n'))
    assert read.titles == ('time, s', 'angle')
    assert read.numbers(1)[0].tolist() == [1.0, 2.0]


@pytest.mark.parametrize(
    ('time', 'unit', 'first', 'step'),
    [
        (['0.5', '0.75'], 's', 500_000_000, 250_000_000),
        (['500', '750'], 'ms', 500_000_000, 250_000_000),
        (['500000', '750000'], 'us', 500_000_000, 250_000_000),
        (['1700000000123456789', '1700000000123457789'], 'ns', 1_700_000_000_123_456_789, 1000),
        (['1700000000.123456789', '1700000000.123457789'], 's', 1_700_000_000_123_456_789, 1000),
        (
            ['2026-01-31T13:45:00.000000001Z', '2026-01-31 14:45:00.25+01:00'],
            'date',
            1_769_867_100_000_000_001,
            249_999_999,
        ),
        (['13:45:00', '13:45:01.5'], 'date', 49_500_000_000_000, 1_500_000_000),
    ],
)
def test_times_of_all_kinds_are_exact(tmp_path, time, unit, first, step):
    text = 't,q\n' + '\n'.join(f'{t},{k}' for k, t in enumerate(time))
    mapping = (
        f'time: {{column: t, unit: {unit}}}\ntopics: {{a/b: {{position: {{q: {{column: q}}}}}}}}'
    )
    _, bag = mapped(tmp_path, text, mapping)
    assert bag.joint_state('a/b').stamp_ns.tolist() == [first, first + step]


def test_an_empty_cell_is_no_sample(tmp_path):
    """As loggers write what is slower than their fastest source."""
    text = 't,q,f\n0,1,5\n1,,6\n2,3,7\n'
    mapping = """
time: {column: t}
topics: {a/q: {position: {q: {column: q}}}, a/f: {effort: {f: {column: f}}}}
"""
    done, bag = mapped(tmp_path, text, mapping)
    assert bag.joint_state('a/q').stamp_ns.tolist() == [0, 2 * 10**9]
    assert bag.joint_state('a/f').effort[:, 0].tolist() == [5.0, 6.0, 7.0]
    assert (done.rows, done.repeated, done.messages) == (3, 0, 5)


@pytest.mark.parametrize(
    ('text', 'error', 'message'),
    [
        ('t,q\n0,1\n1,x\n', BagError, "line 3, column 2 (q): 'x' is not a number"),
        ('t,q\n' + '0,1\n' * 20 + '\n1\n', BagError, 'line 23 has 1 columns, 2 are needed'),
        ('t\n0\n1\n', BagError, 'no separator (semicolon, tab, comma, blanks) cuts'),
        ('t,q\n0,1\nsoon,2\n', BagError, "line 3, column 1 (t): 'soon' is not a number"),
        ('t,q\n0,1\nnan,2\n', BagError, "line 3, column 1 (t): the time 'nan' is not finite"),
        ('t,q\n0,1\n1e30,2\n', BagError, 'no stamp reaches it'),
        ('t,q\n0,1\n1,inf\n', BagError, 'line 3: position of a/b is not finite'),
        ('t,angle\n0,1\n1,2\n', BagError, "no column is named 'q': "),
        ('t,q,q\n0,1,1\n1,2,2\n', BagError, "2 columns are named 'q': give the number"),
        ('t;q\n0;1\n1;2,5\n', BagError, "'2,5' is not a number: decimal_comma: true"),
        ('t,q\n2026-01-31 13:45:00,1\n', BagError, 'fewer than two rows'),
        ('0,1\n1,2\n', BagError, 'the table names no columns: give the number'),
        ('t,q\n', BagError, 'fewer than two rows'),
        ('t,q\n-1,1\n0,2\n', BagError, 'set start_s'),
    ],
)
def test_what_cannot_be_read_is_one_line_with_its_place(tmp_path, text, error, message):
    mapping = 'time: {column: t}\ntopics: {a/b: {position: {q: {column: q}}}}'
    with pytest.raises(error, match=re.escape(message)) as caught:
        mapped(tmp_path, text, mapping)
    assert '\n' not in str(caught.value)
    assert not (tmp_path / 'bag').exists()


def test_a_date_that_is_none_is_named(tmp_path):
    mapping = 'time: {column: t, unit: date}\ntopics: {a/b: {position: {q: {column: q}}}}'
    with pytest.raises(
        BagError, match=re.escape("line 3, column 1 (t): '31.1.2026' is not a date")
    ):
        mapped(tmp_path, 't,q\n2026-01-31 10:00:00,1\n31.1.2026,2\n', mapping)


def test_the_example_in_the_help_is_valid_and_complete(tmp_path):
    (tmp_path / 'm.yaml').write_text(EXAMPLE)
    mapping = load_table_mapping(tmp_path / 'm.yaml')
    assert set(mapping.topics) == {
        'slave/servo_jp',
        'motor/measured_js',
        'slave/measured_js',
        'wires/measured_js',
    }
    keys = {f.name for f in fields(TableMapping)} - {'sample_and_hold'}
    assert all(f'{key}:' in EXAMPLE for key in keys)


def test_a_proposal_is_a_mapping_to_fill_in(tmp_path):
    text = 'time_ms;target [deg];angle [deg]\n' + lines(';', comma=True)
    description = described_table(read_table(table(tmp_path / 't.csv', text)))
    assert [(c.title, c.low, c.high) for c in description.columns] == [
        ('time_ms', None, None),
        ('target [deg]', None, None),
        ('angle [deg]', None, None),
    ]
    source = table(tmp_path / 't.csv', text.replace(',', '.'))
    description = described_table(read_table(source))
    assert [(c.low, c.high) for c in description.columns] == [(0, 0.03), (10, 13.5), (-1.5, 0.5)]
    proposed = description.mapping()
    (tmp_path / 'm.yaml').write_text(proposed)
    with pytest.raises(FileError, match='column'):
        load_table_mapping(tmp_path / 'm.yaml')
    time, rest = '{column: , unit: s}', proposed.index('  motor/servo_jp:')
    filled = proposed[:rest].replace(time, '{column: time_ms, unit: ms}')
    (tmp_path / 'm.yaml').write_text(filled.replace('{column: ,', '{column: "target [deg]",'))
    convert_table(source, load_table_mapping(tmp_path / 'm.yaml'), tmp_path / 'bag')
    command = open_bag(tmp_path / 'bag').joint_state('slave/servo_jp')
    assert np.degrees(command.position[:, 0]) == pytest.approx([10.0, 11.0, 12.0, 13.5])


def test_a_date_before_the_epoch_and_one_without_a_zone():
    assert date_ns('1969-12-31 23:59:59.5') == -500_000_000
    assert date_ns('1970-01-01T01:00:00+01:00') == 0

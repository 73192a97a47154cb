"""A table of numbers in a text file, as loggers write it, and a mapping for it to fill in.

The separator is found by `csv.Sniffer`; empty lines and comments (``#``, ``%``) are no rows.
"""

import csv
import math
import re
import shlex
from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, time
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.errors import BagError
from endoscope_bags.table_mapping import WHITESPACE
from endoscope_core.errors import nearest, printable

LARGEST = 1 << 30
"""Bytes of a table: an hour of ten columns at 1 kHz is 0.3 GB."""
# A comma last: beside another separator it is in numbers.
_SEPARATORS = (';', '\t', ',', ' ')
_SAMPLE = 50
_COMMENTS = '#%'
_FRACTION = re.compile(r'(?P<before>.*:\d\d)[.,](?P<digits>\d+)(?P<after>.*)')

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DelimitedText:
    """The cells of a table, without the lines above the numbers, empty lines and comments."""

    path: Path
    separator: str  # one character, or `WHITESPACE`
    decimal_comma: bool
    header_lines: int  # above the numbers
    titles: tuple[str, ...]  # of the columns; empty where there is none
    # Lines of the file, and which of them are rows, from 1. They are cut when cells are asked for:
    # held as lists of texts, a table takes thirty times its size.
    text: Sequence[str]
    lines: Sequence[int]

    def column(self, which: int | str) -> int:
        """Return the index of a column given by number (from 1), or by name in any case."""
        if isinstance(which, int):
            return which - 1
        wanted = which.strip().casefold()
        found = [k for k, title in enumerate(self.titles) if title.casefold() == wanted]
        if len(found) == 1:
            return found[0]
        if found:
            what = f'{len(found)} columns are named {which!r}: give the number'
        elif not any(self.titles):
            what = f'column {which!r}: the table names no columns: give the number'
        else:
            what = f'no column is named {which!r}: {nearest(which, filter(None, self.titles))}'
        raise BagError(f'{self.path}: {what}')

    def label(self, index: int) -> str:
        """Return what to call a column in a message: number and title."""
        title = self.titles[index] if index < len(self.titles) else ''
        return f'column {index + 1}' + (f' ({title})' if title else '')

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """Yield the cells of each row, with the number of its line."""
        for line in self.lines:
            try:
                yield line, _cut(self.text[line - 1], self.separator)
            except (csv.Error, ValueError) as error:
                raise BagError(f'{self.path}: line {line}: {error}') from error

    def cells(self, index: int) -> list[str]:
        """Return the texts of a column."""
        cells = []
        for line, row in self.rows():
            if len(row) <= index:
                raise BagError(
                    f'{self.path}: line {line} has {len(row)} columns, {index + 1} are needed'
                )
            cells.append(row[index])
        return cells

    def numbers(self, index: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the numbers (N,) of a column, NaN where a cell is empty, and which are (N,)."""
        cells = self.cells(index)
        numbers = np.full(len(cells), math.nan)
        for k, cell in enumerate(cells):
            if cell:
                try:
                    numbers[k] = float(self._with_point(cell))
                except ValueError as error:
                    raise self._no_number(self.lines[k], index, cell) from error
        return numbers, np.array([not cell for cell in cells], dtype=np.bool_)

    def _with_point(self, cell: str) -> str:
        return cell.replace(',', '.') if self.decimal_comma else cell

    def _no_number(self, line: int, index: int, cell: str) -> BagError:
        hint = ''
        if reads_as(float, cell.replace(',', '.')):
            hint = ': decimal_comma: true in the mapping reads it'
        elif reads_as(date_ns, cell):
            hint = ': unit: date in the mapping reads it'
        return BagError(
            f'{self.path}: line {line}, {self.label(index)}: {_shown(cell)} is not a number{hint}'
        )

    def nanoseconds(self, index: int, unit_ns: Decimal) -> NDArray[np.int64]:
        """Return times (N,) counted in `unit_ns` as ns, exactly, however long ago the epoch is."""
        times = []
        for line, cell in zip(self.lines, self.cells(index), strict=True):
            text = self._with_point(cell)
            where = f'{self.path}: line {line}, {self.label(index)}'
            try:
                # What float does not take, such as digits of other scripts, is no number here.
                float(text)
                scaled = Decimal(text) * unit_ns
            except (InvalidOperation, ValueError) as error:
                raise self._no_number(line, index, cell) from error
            if not scaled.is_finite():
                raise BagError(f'{where}: the time {_shown(cell)} is not finite')
            if abs(scaled) >= 1 << 62:
                raise BagError(f'{where}: time {_shown(cell)}: no stamp reaches it')
            times.append(round(scaled))
        return np.array(times, dtype=np.int64)

    def dates(self, index: int) -> NDArray[np.int64]:
        """Return the ns since the epoch (N,) of dates and times (ISO 8601), UTC without a zone."""
        times = []
        for line, cell in zip(self.lines, self.cells(index), strict=True):
            try:
                times.append(date_ns(cell))
            except ValueError as error:
                raise BagError(
                    f'{self.path}: line {line}, {self.label(index)}: {_shown(cell)} is not a date '
                    'and time such as 2026-01-31 13:45:00.250'
                ) from error
        return np.array(times, dtype=np.int64)


def _shown(cell: str) -> str:
    return repr(cell if len(cell) <= 40 else f'{cell[:40]}...')


def date_ns(text: str) -> int:
    """Return the ns since the epoch of a date and time (ISO 8601); ValueError if it is none."""
    fraction = _FRACTION.fullmatch(text)
    ns = int(fraction['digits'][:9].ljust(9, '0')) if fraction else 0
    whole = fraction['before'] + fraction['after'] if fraction else text
    if ':' not in whole:
        raise ValueError('no time of day')
    if '-' not in whole[:5]:
        # A time without a date is since midnight.
        clock = time.fromisoformat(whole)
        moment = datetime.combine(date(1970, 1, 1), clock)
    else:
        moment = datetime.fromisoformat(whole.replace('/', '-'))
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=UTC)
    since = moment - datetime(1970, 1, 1, tzinfo=UTC)
    return (since.days * 86400 + since.seconds) * 10**9 + ns


def reads_as(read: Callable[[str], object], cell: str) -> bool:
    """Return whether a cell parses as a number (`float`, NaN included) or a date (`date_ns`)."""
    try:
        read(cell)
    except ValueError:
        return False
    return True


def read_table(
    path: str | Path,
    *,
    separator: str | None = None,
    header_lines: int | None = None,
    decimal_comma: bool = False,
) -> DelimitedText:
    """Read a table in UTF-8, or in UTF-16 with a byte order mark.

    Where `header_lines` is None, the first line that is not empty names the columns, unless it
    holds nothing but numbers and dates. The last line above the numbers may be a comment.
    """
    path = Path(path)
    text = _lines(path)
    first = next((k for k, line in enumerate(text) if line.strip()), 0)
    if separator is None:
        separator = _separator(path, text[first if header_lines is None else header_lines :])
    if header_lines is None:
        cells = [cell.replace(',', '.') for cell in _cut(text[first], separator) if cell]
        header_lines = first + (
            not all(reads_as(float, cell) or reads_as(date_ns, cell) for cell in cells)
        )
    above = [line for line in text[:header_lines] if line.strip()]
    lines = array(
        'q',
        (
            number
            for number, line in enumerate(text[header_lines:], header_lines + 1)
            if line.strip() and not line.lstrip().startswith(tuple(_COMMENTS))
        ),
    )
    if len(lines) < 2:
        raise BagError(f'{path}: fewer than two rows')
    titles = _cut(above[-1].lstrip(_COMMENTS), separator) if above else []
    return DelimitedText(path, separator, decimal_comma, header_lines, tuple(titles), text, lines)


def _lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > LARGEST:
            raise BagError(f'{path} is larger than {LARGEST >> 30} GiB: cut it into parts')
        content = path.read_bytes()
    except OSError as error:
        raise BagError(f'{path} cannot be read: {error}') from error
    wide = content.startswith((b'\xff\xfe', b'\xfe\xff'))
    try:
        text = content.decode('utf-16' if wide else 'utf-8-sig')
    except UnicodeDecodeError as error:
        line = 1 + len(re.findall(b'\r\n|\n|\r', content[: error.start]))
        raise BagError(
            f'{path}: line {line}: byte 0x{content[error.start]:02x} is not {error.encoding}; text '
            'of Windows or Latin-1? Save it as UTF-8, for example by '
            f'iconv -f WINDOWS-1252 -t UTF-8 {shlex.quote(str(path))} -o utf8.csv'
        ) from error
    return re.split('\r\n|\n|\r', text)


def _separator(path: Path, lines: Sequence[str]) -> str:
    bare = (line.lstrip(_COMMENTS + ' ') for line in lines[:_SAMPLE])
    sample = '\n'.join(filter(None, bare))
    for candidate in _SEPARATORS:
        try:
            found = csv.Sniffer().sniff(sample, candidate).delimiter
        except csv.Error:
            continue
        return WHITESPACE if found == ' ' else found
    raise BagError(
        f'{path}: no separator (semicolon, tab, comma, blanks) cuts its lines into as many cells '
        'each: give delimiter and header_lines in the mapping'
    )


def _cut(line: str, separator: str) -> list[str]:
    if separator == WHITESPACE:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    [row] = csv.reader([line], delimiter=separator)
    return [cell.strip() for cell in row]


_TO_FILL_IN = """\
time: {column: , unit: s}       # or ms, us, ns, date
topics:                         # delete what the table lacks
  slave/servo_jp:               # desired angle
    position: {bend_x: {column: , unit: deg}}
  motor/servo_jp:               # command to the shaft
    position: {motor_x: {column: , unit: rad}}
  motor/measured_js:
    position: {motor_x: {column: , unit: rad}}
  slave/measured_js:
    position: {bend_x: {column: , unit: deg}}
  wires/measured_js:
    effort: {wire_x_pos: {column: , unit: N}, wire_x_neg: {column: , unit: N}}
"""


@dataclass(frozen=True)
class TableColumn:
    """A column of a table as it stands there."""

    number: int  # from 1
    title: str  # empty where it has none
    low: float | None  # None, like `high`, of what is no number
    high: float | None
    first: str  # its first cell

    @property
    def range(self) -> str:
        """From where to where its numbers reach."""
        if self.low is None:
            return f'such as {self.first[:40]}'
        return f'{self.low:.6g} to {self.high:.6g}'


@dataclass(frozen=True)
class TableDescription:
    """What is in a table."""

    table: str
    rows: int
    separator: str
    header_lines: int
    columns: tuple[TableColumn, ...]

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**vars(self), 'columns': [vars(column) for column in self.columns]}

    def __str__(self) -> str:
        named = {'\t': 'tabs', WHITESPACE: 'blanks'}.get(self.separator, self.separator)
        head = f'{self.table}: {self.rows} rows of {len(self.columns)} columns, separated by '
        return '\n'.join(map(printable, [head + named, *self._lines()]))

    def _lines(self) -> Iterator[str]:
        width = max(len(column.title) for column in self.columns)
        for column in self.columns:
            yield f'{column.number:3}  {column.title:{width}}  {column.range}'

    def mapping(self) -> str:
        """Return a mapping file whose columns are to be filled in, with this as comments."""
        head = (
            *(f'# {line}' for line in str(self).splitlines()),
            '# Fill in the column of each quantity, by its name or number, and its unit.',
            '# `endoscope convert --help` has all keys and units.',
            f'delimiter: {"whitespace" if self.separator == WHITESPACE else repr(self.separator)}',
            f'header_lines: {self.header_lines}',
        )
        return '\n'.join(head) + '\n' + _TO_FILL_IN


def described_table(text: DelimitedText) -> TableDescription:
    """Describe all columns of the first row."""
    _, row = next(text.rows())
    columns = tuple(_column(text, index, cell) for index, cell in enumerate(row))
    return TableDescription(
        str(text.path), len(text.lines), text.separator, text.header_lines, columns
    )


def _column(text: DelimitedText, index: int, first: str) -> TableColumn:
    title = text.titles[index] if index < len(text.titles) else ''
    try:
        numbers, _ = text.numbers(index)
    except BagError:
        numbers = np.empty(0)
    numbers = numbers[np.isfinite(numbers)]
    if not len(numbers):
        return TableColumn(index + 1, title, None, None, first)
    return TableColumn(index + 1, title, float(numbers.min()), float(numbers.max()), first)

"""A table of numbers in a text file, as loggers and spreadsheets write it.

Found from the file: byte order mark, comments (``#``, ``%``), the separator, the decimal comma,
lines above the numbers, and among them the names and units of the columns.
"""

import csv
import math
import re
from array import array
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime, time
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.errors import BagError
from endoscope_bags.table_mapping import WHITESPACE, known_unit
from endoscope_core.errors import nearest

SEPARATORS = (';', '\t', ',', WHITESPACE)
LARGEST = 1 << 30
"""Bytes of a table: an hour of ten columns at 1 kHz is 0.3 GB."""
_SAMPLE = 200
_COMMENTS = ('#', '%')
_DECIMAL_COMMA = re.compile(r'[+-]?\d*,\d+(?:[eE][+-]?\d+)?')
_FRACTION = re.compile(r'(?P<before>.*:\d\d)[.,](?P<digits>\d+)(?P<after>.*)')
# "angle [deg]", "force (N)", "time_ms": a name and the unit of its numbers.
_BRACKETED = re.compile(r'(?P<name>.*?)[\s_]*[\[(](?P<unit>[^\[\]()]*)[\])]\s*')
_SUFFIXED = re.compile(r'(?P<name>.+?)[\s_](?P<unit>[A-Za-zµμ°/]+)')

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Heading:
    """What stands above a column."""

    title: str = ''  # as in the file; empty where there is none
    name: str = ''  # without the unit
    # As `units.UNITS` has it; None where the heading tells none that is known.
    unit: str | None = None


@dataclass(frozen=True)
class DelimitedText:
    """The cells of a table, without the lines above the numbers, empty lines and comments."""

    path: Path
    separator: str  # one character, or `WHITESPACE`
    decimal_comma: bool
    headings: tuple[Heading, ...]  # one for each column
    # Cut when they are asked for: held as lists of texts, a table takes thirty times its size.
    rows: Sequence[Sequence[str]]
    lines: Sequence[int]  # number of each row's line in the file, from 1

    def column(self, which: int | str) -> int:
        """Return the index of a column given by number (from 1), or title or name in any case."""
        if isinstance(which, int):
            return which - 1
        wanted = which.strip().casefold()
        for key in ('title', 'name'):
            found = [
                k for k, each in enumerate(self.headings) if getattr(each, key).casefold() == wanted
            ]
            if len(found) > 1:
                raise BagError(
                    f'{self.path}: {len(found)} columns are named {which!r}: give the number'
                )
            if found:
                return found[0]
        titles = [each.title for each in self.headings if each.title]
        if not titles:
            raise BagError(
                f'{self.path}: column {which!r}: the table names no columns: give the number'
            )
        raise BagError(f'{self.path}: no column is named {which!r}: {nearest(which, titles)}')

    def label(self, index: int) -> str:
        """Return what to call a column in a message: number and title."""
        title = self.headings[index].title if index < len(self.headings) else ''
        return f'column {index + 1}' + (f' ({title})' if title else '')

    def cells(self, index: int) -> list[str]:
        """Return the texts of a column."""
        try:
            return [row[index] for row in self.rows]  # one column at a time
        except IndexError:
            short, line = next(
                (row, line)
                for row, line in zip(self.rows, self.lines, strict=True)
                if len(row) <= index
            )
            raise BagError(
                f'{self.path}: line {line} has {len(short)} columns, {index + 1} are needed'
            ) from None

    def numbers(self, index: int) -> tuple[Array, NDArray[np.bool_]]:
        """Return the numbers (N,) of a column, NaN where a cell is empty, and which are (N,)."""
        cells = self.cells(index)
        empty = np.array([not cell for cell in cells], dtype=np.bool_)
        try:
            return np.array([self._number(cell) for cell in cells]), empty
        except ValueError:
            line, cell = next(
                (line, cell)
                for line, cell in zip(self.lines, cells, strict=True)
                if not is_number(cell, self.decimal_comma) and cell
            )
            raise BagError(
                f'{self.path}: line {line}, {self.label(index)}: {_shown(cell)} is not a number'
            ) from None

    def _number(self, cell: str) -> float:
        if not cell:
            return math.nan
        return float(cell.replace(',', '.') if self.decimal_comma else cell)

    def nanoseconds(self, index: int, unit_ns: Decimal) -> NDArray[np.int64]:
        """Return times (N,) counted in `unit_ns` as ns, exactly, however long ago the epoch is."""
        times = []
        for line, cell in zip(self.lines, self.cells(index), strict=True):
            text = cell.replace(',', '.') if self.decimal_comma else cell
            where = f'{self.path}: line {line}, {self.label(index)}'
            try:
                # What float does not take, such as digits of other scripts, is no number here.
                float(text)
                scaled = Decimal(text) * unit_ns
            except (InvalidOperation, ValueError) as error:
                raise BagError(f'{where}: {_shown(cell)} is not a number') from error
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


def is_number(cell: str, decimal_comma: bool = False) -> bool:
    """Tell whether a cell reads as a number (NaN and infinity are some)."""
    try:
        float(cell.replace(',', '.') if decimal_comma else cell)
    except ValueError:
        return False
    return True


def is_date(cell: str) -> bool:
    """Tell whether a cell reads as a date and time, or as a time of day."""
    try:
        date_ns(cell)
    except ValueError:
        return False
    return True


def read_table(
    path: str | Path,
    *,
    separator: str | None = None,
    header_lines: int | None = None,
    decimal_comma: bool | None = None,
) -> DelimitedText:
    """Read a table in UTF-8, or UTF-16 with a byte order mark; what is None is found from it."""
    path = Path(path)
    lines = _lines(path)
    above = lines[:header_lines] if header_lines is not None else []
    numbers = array(
        'q',
        (
            number
            for number, line in enumerate(lines[len(above) :], len(above) + 1)
            if line.strip() and not line.lstrip().startswith(_COMMENTS)
        ),
    )
    if not numbers:
        raise BagError(f'{path}: fewer than two rows')
    if separator is None:
        sample = [lines[number - 1] for number in numbers[:_SAMPLE]]
        separator = min(SEPARATORS, key=lambda each: _badness(sample, each))
    cells = _Rows(path, lines, numbers, separator)
    if decimal_comma is None:
        decimal_comma = separator != ',' and any(
            _DECIMAL_COMMA.fullmatch(cell) for row in cells[:_SAMPLE] for cell in row
        )
    first = 0 if header_lines is not None else _first_row(cells, decimal_comma)
    if len(cells) - first < 2:
        raise BagError(f'{path}: fewer than two rows')
    begin = numbers[first]
    width = len(cells[first])
    titles = _title_rows(path, lines[: begin - 1], separator, width)
    return DelimitedText(
        path,
        separator,
        decimal_comma,
        _headings(titles, width),
        _Rows(path, lines, numbers[first:], separator),
        numbers[first:],
    )


def _lines(path: Path) -> list[str]:
    try:
        if path.stat().st_size > LARGEST:
            raise BagError(f'{path} is larger than {LARGEST >> 30} GiB: cut it into parts')
        content = path.read_bytes()
        wide = content.startswith((b'\xff\xfe', b'\xfe\xff'))
        text = content.decode('utf-16' if wide else 'utf-8-sig')
    except (OSError, UnicodeDecodeError) as error:
        raise BagError(f'{path} cannot be read: {error}') from error
    return re.split('\r\n|\n|\r', text)


def _badness(lines: Sequence[str], separator: str) -> tuple[float, int]:
    """How badly a separator cuts lines into as many numbers each: share of bad lines, and order."""
    rows = [_cut(line, separator) for line in lines]
    widths = Counter(len(row) for row in rows if len(row) > 1)
    if not widths:
        return 1.0, SEPARATORS.index(separator)
    width = max(widths, key=lambda each: (widths[each], each))
    comma = separator != ','
    good = sum(
        len(row) == width
        and sum(is_number(cell, comma) or is_date(cell) or not cell for cell in row) >= width / 2
        for row in rows
    )
    return 1.0 - good / len(rows), SEPARATORS.index(separator)


def _cut(line: str, separator: str) -> list[str]:
    if separator == WHITESPACE:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    [row] = csv.reader([line], delimiter=separator)
    return [cell.strip() for cell in row]


@dataclass(frozen=True)
class _Rows(Sequence[list[str]]):
    """Some lines of a file as rows of cells."""

    path: Path
    lines: Sequence[str]
    numbers: Sequence[int]
    separator: str

    def __len__(self) -> int:
        return len(self.numbers)

    def __iter__(self) -> Iterator[list[str]]:
        return map(self._row, self.numbers)

    @overload
    def __getitem__(self, which: int) -> list[str]: ...

    @overload
    def __getitem__(self, which: slice) -> list[list[str]]: ...

    def __getitem__(self, which: int | slice) -> list[str] | list[list[str]]:
        if isinstance(which, slice):
            return [self._row(number) for number in self.numbers[which]]
        return self._row(self.numbers[which])

    def _row(self, number: int) -> list[str]:
        try:
            return _cut(self.lines[number - 1], self.separator)
        except (csv.Error, ValueError) as error:
            raise BagError(f'{self.path}: line {number}: {error}') from error


def _first_row(cells: Sequence[Sequence[str]], decimal_comma: bool) -> int:
    """Index of the first row of numbers: none of the rows above has a number in most columns."""
    widths = Counter(len(row) for row in cells[-_SAMPLE:])
    width = max(widths, key=lambda each: widths[each])

    def is_data(row: Sequence[str]) -> bool:
        told = [is_number(cell, decimal_comma) or is_date(cell) for cell in row if cell]
        return bool(told) and sum(told) * 2 > len(told)

    for index, row in enumerate(cells):
        # A line such as "sampling rate, 1000" is no row of a table of four columns.
        if is_data(row) and (len(row) == width or all(is_number(cell) for cell in row)):
            return index
    return len(cells)


def _title_rows(path: Path, above: Sequence[str], separator: str, width: int) -> list[list[str]]:
    """Lines above the numbers that have as many cells, the last one first, comments included."""
    rows = []
    for line in reversed(above[-_SAMPLE:]):
        bare = line.strip().lstrip(''.join(_COMMENTS)).strip() if line.strip() else ''
        for cut in dict.fromkeys((separator, *SEPARATORS)) if bare else ():
            row = _Rows(path, [bare], [1], cut)[0]
            if len(row) == width and not all(is_number(cell) for cell in row if cell):
                rows.append(row)
                break
    return rows


def _headings(rows: Sequence[Sequence[str]], width: int) -> tuple[Heading, ...]:
    if not rows:
        return (Heading(),) * width
    units = [known_unit(cell.strip('[]() ')) for cell in rows[0]]
    is_unit_line = len(rows) > 1 and all(
        unit is not None or not cell.strip('[]() -')
        for unit, cell in zip(units, rows[0], strict=True)
    )
    if is_unit_line:
        return tuple(Heading(t, t, unit) for t, unit in zip(rows[1], units, strict=True))
    return tuple(_heading(title) for title in rows[0])


def _heading(title: str) -> Heading:
    for form in (_BRACKETED, _SUFFIXED):
        match = form.fullmatch(title)
        if match and known_unit(match['unit']):
            return Heading(title, match['name'].strip(), known_unit(match['unit']))
    return Heading(title, title)

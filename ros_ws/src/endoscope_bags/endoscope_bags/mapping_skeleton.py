"""Description of an unknown table, and a mapping to fill in: `convert --propose`."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from endoscope_bags.delimited_text import DelimitedText
from endoscope_bags.errors import BagError
from endoscope_bags.table_mapping import WHITESPACE
from endoscope_core.errors import printable

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

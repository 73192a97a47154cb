"""From a text table of measurements to a bag."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.bag_writer import BagWriter, MessageStream
from endoscope_bags.cdr import encode_joint_states
from endoscope_bags.delimited_text import DelimitedText, read_table
from endoscope_bags.errors import BagError
from endoscope_bags.information import SILENT_PERIODS
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bags.table_mapping import DATE, UNITS, Column, TableMapping

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Rows between times may lie as far behind the last one as it lies behind the epoch.
_LATEST = 1 << 62
# Encoded messages are ten times the size of the numbers in them.
_ROWS_AT_ONCE = 20_000


@dataclass(frozen=True)
class Converted:
    """Result of a conversion."""

    rows: int
    messages: int
    repeated: int = 0  # rows that were dropped because their time is that of the row before
    # Rows without a message, where the table samples and holds: nothing in them is new.
    held: int = 0
    # Rows by topic that were dropped because a part of its cells is empty or not finite.
    incomplete: dict[str, int] = field(default_factory=dict)
    # Cells that are empty or not finite, by the name of the column.
    gaps: dict[str, int] = field(default_factory=dict)

    def __str__(self) -> str:
        dropped = [f'{self.repeated} with the time of the row before'] if self.repeated else []
        dropped += [f'{self.held} that repeat what their sources gave before'] if self.held else []
        dropped += [
            f'{rows} of {topic} for a cell without a number'
            for topic, rows in self.incomplete.items()
        ]
        text = f'{self.messages} messages of {self.rows} rows'
        text += f'; dropped rows: {", ".join(dropped)}' if dropped else ''
        empty = [f'{cells} of {column}' for column, cells in self.gaps.items()]
        return text + (f'; cells that are empty or not finite: {", ".join(empty)}' if empty else '')


def convert_table(
    table: str | Path,
    mapping: TableMapping,
    out: str | Path,
    progress: Callable[[str, float], None] = lambda step, share: None,
) -> Converted:
    """Convert a text table to a new bag; `progress` gets what is done and the share done."""
    table = Path(table)
    progress('reading the table', 0.0)
    text = read_table(
        table,
        separator=mapping.delimiter,
        header_lines=mapping.header_lines,
        decimal_comma=mapping.decimal_comma,
    )
    time = _times(text, mapping.time, mapping.start_s)
    _check(text, time)
    kept = np.ones(len(time), bool)
    if mapping.sample_and_hold:
        time = _between_times(table, time)
    elif mapping.drop_repeats is not False:
        kept[1:] = np.diff(time) != 0
    rows, used = len(time), np.zeros(len(time), bool)
    incomplete: dict[str, int] = {}
    gaps: dict[str, int] = {}
    streams: list[tuple[str, list[str], dict[str, Array], Mask]] = []
    for k, (topic, quantities) in enumerate(mapping.topics.items()):
        progress(topic, 0.1 + 0.5 * k / len(mapping.topics))
        values, fresh = _values(
            text, topic, quantities, mapping.incomplete_rows == 'drop', incomplete, gaps
        )
        fresh &= kept
        if mapping.sample_and_hold:
            fresh &= _sampled(np.concatenate(list(values.values()), axis=1))
        used |= fresh
        streams.append((topic, list(next(iter(quantities.values()))), values, fresh))
    del text
    with BagWriter(out) as bag:
        for first in range(0, rows, _ROWS_AT_ONCE):
            progress('writing the bag', 0.6 + 0.4 * first / rows)
            block = slice(first, first + _ROWS_AT_ONCE)
            bag.write_streams([_stream(mapping, time, block, *each) for each in streams])
        messages = bag.message_count
    unused = rows - int(used.sum())
    held = unused if mapping.sample_and_hold else 0
    return Converted(rows, messages, unused - held, held, incomplete, gaps)


def _stream(
    mapping: TableMapping,
    time: Stamps,
    block: slice,
    topic: str,
    names: list[str],
    values: Mapping[str, Array],
    fresh: Mask,
) -> MessageStream:
    """Messages of a topic in some of the rows."""
    stamps = time[block][fresh[block]]
    numbers = {quantity: array[block][fresh[block]] for quantity, array in values.items()}
    return MessageStream(
        f'{mapping.namespace}/{topic}',
        JOINT_STATE,
        encode_joint_states(
            names,
            stamps,
            position=numbers.get('position'),
            velocity=numbers.get('velocity'),
            effort=numbers.get('effort'),
        ),
        stamps,
    )


def _times(text: DelimitedText, column: Column, start_s: float) -> Stamps:
    index = text.column(column.column)
    start = round(start_s * 1e9)
    if column.unit == DATE:
        return text.dates(index) + start
    in_ns = Decimal(repr(UNITS[column.unit])) * 10**9
    offset = round(Decimal(repr(column.offset)) * in_ns) + start
    if abs(offset) >= _LATEST:
        raise BagError(f'{text.path}: offset or start_s: no stamp reaches it')
    times = text.nanoseconds(index, in_ns * Decimal(repr(column.scale)))
    return times + offset


def _values(
    text: DelimitedText,
    topic: str,
    quantities: Mapping[str, Mapping[str, Column]],
    drop: bool,
    incomplete: dict[str, int],
    gaps: dict[str, int],
) -> tuple[dict[str, Array], Mask]:
    """Values (N, J) in SI and rows (N,) with a sample; fills `incomplete` and `gaps`."""
    values, absent, unusable = {}, [], []
    for quantity, columns in quantities.items():
        read = []
        for column in columns.values():
            numbers, empty = _si(text, column)
            read.append(numbers)
            absent.append(empty)
            unusable.append(~np.isfinite(numbers))
            if unusable[-1].any():
                gaps[text.label(text.column(column.column))] = int(unusable[-1].sum())
        values[quantity] = np.stack(read, axis=1)
    sampled: Mask = ~np.all(absent, axis=0)
    if not sampled.any():
        raise BagError(f'{text.path}: {topic} has no number in any row')
    bad = np.any(unusable, axis=0) & sampled
    if not bad.any():
        return values, sampled
    if drop:
        incomplete[topic] = int(bad.sum())
        if not (sampled & ~bad).any():
            raise BagError(f'{text.path}: {topic} has no row with all its numbers')
        return values, sampled & ~bad
    row = int(np.argmax(bad))
    hint = (
        f'{int(bad.sum())} of {len(bad)} rows are so; `incomplete_rows: drop` in the mapping '
        'leaves them out'
    )
    where = f'{text.path}: line {text.lines[row]}'
    if np.any(absent, axis=0)[row]:
        raise BagError(f'{where}: only a part of {topic} has a number there; {hint}')
    quantity = next(q for q, array in values.items() if not np.isfinite(array[row]).all())
    raise BagError(f'{where}: {quantity} of {topic} is not finite; {hint}')


def _si(text: DelimitedText, column: Column) -> tuple[Array, Mask]:
    numbers, empty = text.numbers(text.column(column.column))
    # What goes beyond all numbers is found by its not being finite.
    with np.errstate(over='ignore', invalid='ignore'):
        return UNITS[column.unit] * (numbers * column.scale + column.offset), empty


def _sampled(values: Array) -> Mask:
    """Rows (N,) of values (N, K) in which their source has sampled.

    That is where a number changes. A source that rests gives the same number again: where none
    changes for what `bag info` calls a silence, a sample is taken at the usual interval of changes.
    """
    changed = np.r_[True, np.diff(values, axis=0).any(axis=1)]
    first = np.flatnonzero(changed)
    steps = np.diff(np.r_[first, len(values)])
    # The last rest may go on behind the table.
    usual = max(1, round(float(np.median(steps[:-1])))) if len(steps) > 1 else 1
    since = np.arange(len(values)) - np.repeat(first, steps)
    rests = np.repeat(steps > SILENT_PERIODS * usual, steps)
    sampled: Mask = changed | (rests & (since % usual == 0))
    return sampled


def _between_times(table: Path, time: Stamps) -> Stamps:
    """Times of rows that lie evenly between the time that they share and the next one."""
    first = np.flatnonzero(np.r_[True, np.diff(time) > 0])
    if len(first) < 2:
        raise BagError(f'{table}: all rows have the same time: where a row lies is not known')
    rows = np.diff(np.r_[first, len(time)])
    steps = np.diff(time[first]) / rows[:-1]
    steps = np.r_[steps, steps[-1]]
    since = (np.arange(len(time)) - np.repeat(first, rows)) * np.repeat(steps, rows)
    return time + np.round(since).astype(np.int64)


def _check(text: DelimitedText, time: Stamps) -> None:
    if np.abs(time).max() >= _LATEST:
        raise BagError(f'{text.path}: time reaches {np.abs(time).max() * 1e-9:g} s: no stamp can')
    if time[0] < 0:
        raise BagError(
            f'{text.path}: time begins at {time[0] * 1e-9:g} s: set start_s in the mapping'
        )
    backward = np.flatnonzero(np.diff(time) < 0)
    if len(backward):
        row = int(backward[0])
        raise BagError(
            f'{text.path}: line {text.lines[row + 1]}: time runs backwards, from '
            f'{time[row] * 1e-9:g} to {time[row + 1] * 1e-9:g} s'
        )

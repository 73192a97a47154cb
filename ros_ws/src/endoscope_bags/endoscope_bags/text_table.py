"""From a text table of measurements to a bag."""

from collections.abc import Mapping
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.bag_writer import BagWriter
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.delimited_text import DelimitedText, TableError, is_date, is_number, read_table
from endoscope_bags.errors import NonFiniteError
from endoscope_bags.message_stream import MessageStream
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bags.table_mapping import Column, TableMapping
from endoscope_bags.units import DATE, TIME_UNITS, UNITS

Array = NDArray[np.float64]
Stamps = NDArray[np.int64]
Mask = NDArray[np.bool_]

# Rows between times may lie as far behind the last one as it lies behind the epoch.
_LATEST = 1 << 62


@dataclass(frozen=True)
class Converted:
    """What was converted.

    Attributes
    ----------
    rows : int
        Rows of the table.
    repeated : int
        Those of them that were dropped because their time is that of the row before or, where the
        table samples and holds, because no topic has a new number in them.
    messages : int
    """

    rows: int
    repeated: int
    messages: int


def convert_table(table: str | Path, mapping: TableMapping, out: str | Path) -> Converted:
    """Convert a text table to a bag.

    Parameters
    ----------
    table : str or Path
    mapping : TableMapping
        What its columns are.
    out : str or Path
        rosbag2 folder, or `.mcap`; must not exist.

    Returns
    -------
    Converted

    Raises
    ------
    TableError
        If the table cannot be read, lacks a column, or its time runs backwards; names the line.
    NonFiniteError
        If a number is NaN or infinite.
    BagExistsError
        If `out` exists.
    """
    table = Path(table)
    text = read_table(
        table,
        separator=mapping.delimiter,
        header_lines=mapping.header_lines,
        decimal_comma=mapping.decimal_comma,
    )
    time = _times(text, mapping.time, mapping.start_s)
    _check(table, time)
    kept = np.ones(len(time), bool)
    if mapping.sample_and_hold:
        time = _between_times(table, time)
    elif mapping.drop_repeats:
        kept[1:] = np.diff(time) != 0
    used = np.zeros(len(time), bool)
    streams = []
    for topic, quantities in mapping.topics.items():
        names = list(next(iter(quantities.values())))
        values, fresh = _values(text, topic, quantities)
        fresh &= kept
        if mapping.sample_and_hold:
            fresh[1:] &= np.any([np.diff(v, axis=0).any(axis=1) for v in values.values()], axis=0)
        used |= fresh
        stamps = time[fresh]
        streams.append(
            MessageStream(
                f'{mapping.namespace}/{topic}',
                JOINT_STATE,
                encode_joint_states(
                    names,
                    stamps,
                    position=values['position'][fresh] if 'position' in values else None,
                    velocity=values['velocity'][fresh] if 'velocity' in values else None,
                    effort=values['effort'][fresh] if 'effort' in values else None,
                ),
                stamps,
            )
        )
    with BagWriter(out) as bag:
        bag.write_streams(streams)
    rows = len(time)
    return Converted(rows, rows - int(used.sum()), sum(len(stream.payloads) for stream in streams))


def _times(text: DelimitedText, column: Column, start_s: float) -> Stamps:
    index = text.column(column.source)
    cells = text.cells(index)
    unit = column.unit or text.headings[index].unit if index < len(text.headings) else column.unit
    if unit is None:
        unit = DATE if is_date(cells[0]) and not is_number(cells[0], text.decimal_comma) else 's'
    if unit not in TIME_UNITS:
        raise TableError(f'{text.path}: {text.label(index)} is in {unit}: that is no time')
    start = round(start_s * 1e9)
    if unit == DATE:
        return text.dates(index) + start
    in_ns = Decimal(repr(UNITS[unit])) * 10**9
    offset = round(Decimal(repr(column.offset)) * in_ns) + start
    if abs(offset) >= _LATEST:
        raise TableError(f'{text.path}: offset or start_s: no stamp reaches it')
    times = text.nanoseconds(index, in_ns * Decimal(repr(column.scale)))
    return times + offset


def _values(
    text: DelimitedText, topic: str, quantities: Mapping[str, Mapping[str, Column]]
) -> tuple[dict[str, Array], Mask]:
    """Values of a topic by quantity, each (N, J) in SI, and the rows that have a sample, (N,)."""
    values, absent = {}, []
    for quantity, columns in quantities.items():
        read = [_si(text, column) for column in columns.values()]
        values[quantity] = np.stack([numbers for numbers, _ in read], axis=1)
        absent += [empty for _, empty in read]
    sampled: Mask = ~np.all(absent, axis=0)
    partly = np.any(absent, axis=0) & sampled
    if partly.any():
        line = text.lines[int(np.argmax(partly))]
        raise TableError(f'{text.path}: line {line}: only a part of {topic} has a number there')
    if not sampled.any():
        raise TableError(f'{text.path}: {topic} has no number in any row')
    for quantity, array in values.items():
        _check_finite(text, topic, quantity, array, sampled)
    return values, sampled


def _si(text: DelimitedText, column: Column) -> tuple[Array, Mask]:
    index = text.column(column.source)
    numbers, empty = text.numbers(index)
    unit = column.unit or text.headings[index].unit or '-'
    # What goes beyond all numbers is found by its not being finite.
    with np.errstate(over='ignore', invalid='ignore'):
        return UNITS[unit] * (numbers * column.scale + column.offset), empty


def _between_times(table: Path, time: Stamps) -> Stamps:
    """Times of rows that lie evenly between the time that they share and the next one."""
    first = np.flatnonzero(np.r_[True, np.diff(time) > 0])
    if len(first) < 2:
        raise TableError(f'{table}: all rows have the same time: where a row lies is not known')
    rows = np.diff(np.r_[first, len(time)])
    steps = np.diff(time[first]) / rows[:-1]
    steps = np.r_[steps, steps[-1]]
    since = (np.arange(len(time)) - np.repeat(first, rows)) * np.repeat(steps, rows)
    return time + np.round(since).astype(np.int64)


def _check(table: Path, time: Stamps) -> None:
    if np.abs(time).max() >= _LATEST:
        raise TableError(f'{table}: time reaches {np.abs(time).max() * 1e-9:g} s: no stamp can')
    if time[0] < 0:
        raise TableError(
            f'{table}: time begins at {time[0] * 1e-9:g} s: set start_s in the mapping'
        )
    backward = np.flatnonzero(np.diff(time) < 0)
    if len(backward):
        raise TableError(f'{table}: time runs backwards after {time[backward[0]] * 1e-9:g} s')


def _check_finite(
    text: DelimitedText, topic: str, quantity: str, values: Array, sampled: Mask
) -> None:
    bad = ~np.isfinite(values).all(axis=1) & sampled
    if bad.any():
        row = int(np.argmax(bad))
        raise NonFiniteError(
            f'{text.path}: {quantity} of {topic} is not finite in line {text.lines[row]} and '
            f'{int(bad.sum()) - 1} more'
        )

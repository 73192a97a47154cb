"""From a text table of measurements to a bag."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.bag_writer import BagWriter
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.errors import BagError, NonFiniteError
from endoscope_bags.message_stream import MessageStream
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bags.table_mapping import Column, TableMapping

Array = NDArray[np.float64]


# A bag counts nanoseconds in 63 bits; rows between times may lie as far behind the last one.
_LATEST = 2.0**62 * 1e-9


class TableError(BagError, ValueError):
    """A text table that cannot be converted; the message names the file and the line."""


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
        If the table cannot be read, has too few columns, or its time runs backwards.
    NonFiniteError
        If a number is NaN or infinite.
    BagExistsError
        If `out` exists.
    """
    table = Path(table)
    numbers = _read(table, mapping)
    rows = len(numbers)
    time = _si(numbers, mapping.time) + mapping.start_s
    _check(table, time)
    if mapping.drop_repeats and not mapping.sample_and_hold:
        fresh = np.r_[True, np.diff(time) != 0.0]
        numbers, time = numbers[fresh], time[fresh]
    if mapping.sample_and_hold:
        time = _between_times(table, time)
    used = np.zeros(len(time), bool)
    streams = []
    for topic, quantities in mapping.topics.items():
        names = list(next(iter(quantities.values())))
        values = {
            quantity: np.stack([_si(numbers, column) for column in columns.values()], axis=1)
            for quantity, columns in quantities.items()
        }
        for quantity, array in values.items():
            _check_finite(table, topic, quantity, array)
        fresh = np.ones(len(time), bool)
        if mapping.sample_and_hold:
            fresh[1:] = np.any([np.diff(v, axis=0).any(axis=1) for v in values.values()], axis=0)
            values = {quantity: array[fresh] for quantity, array in values.items()}
        used |= fresh
        stamps = np.round(time[fresh] * 1e9).astype(np.int64)
        streams.append(
            MessageStream(
                f'{mapping.namespace}/{topic}',
                JOINT_STATE,
                encode_joint_states(
                    names,
                    stamps,
                    position=values.get('position'),
                    velocity=values.get('velocity'),
                    effort=values.get('effort'),
                ),
                stamps,
            )
        )
    with BagWriter(out) as bag:
        bag.write_streams(streams)
    return Converted(rows, rows - int(used.sum()), sum(len(stream.payloads) for stream in streams))


def _read(table: Path, mapping: TableMapping) -> Array:
    try:
        lines = table.read_text(encoding='utf-8').splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TableError(f'{table} cannot be read: {error}') from error
    needed = max(c.number for c in _columns(mapping))
    rows = []
    for number, line in enumerate(lines[mapping.header_lines :], mapping.header_lines + 1):
        if not line.strip():
            continue
        cells = line.split(mapping.delimiter)
        if len(cells) < needed:
            raise TableError(
                f'{table}: line {number} has {len(cells)} columns, {needed} are needed'
            )
        try:
            rows.append([float(cell) for cell in cells[:needed]])
        except ValueError as error:
            raise TableError(f'{table}: line {number} holds something else than numbers') from error
    if len(rows) < 2:
        raise TableError(f'{table}: fewer than two rows')
    return np.array(rows)


def _columns(mapping: TableMapping) -> list[Column]:
    return [
        mapping.time,
        *(
            column
            for quantities in mapping.topics.values()
            for columns in quantities.values()
            for column in columns.values()
        ),
    ]


def _si(numbers: Array, column: Column) -> Array:
    # What goes beyond all numbers is found by its not being finite.
    with np.errstate(over='ignore', invalid='ignore'):
        return np.asarray(numbers[:, column.number - 1] * column.scale + column.offset)


def _between_times(table: Path, time: Array) -> Array:
    """Times of rows that lie evenly between the time that they share and the next one."""
    first = np.flatnonzero(np.r_[True, np.diff(time) > 0.0])
    if len(first) < 2:
        raise TableError(f'{table}: all rows have the same time: where a row lies is not known')
    rows = np.diff(np.r_[first, len(time)])
    steps = np.diff(time[first]) / rows[:-1]
    steps = np.r_[steps, steps[-1]]
    return np.asarray(
        time + (np.arange(len(time)) - np.repeat(first, rows)) * np.repeat(steps, rows)
    )


def _check(table: Path, time: Array) -> None:
    _check_finite(table, 'the time', 'column', time[:, None])
    if np.abs(time).max() >= _LATEST:
        raise TableError(f'{table}: time reaches {np.abs(time).max():g} s: no stamp can')
    if time[0] < 0.0:
        raise TableError(f'{table}: time begins at {time[0]:g} s: set start_s in the mapping')
    backward = np.flatnonzero(np.diff(time) < 0.0)
    if len(backward):
        raise TableError(f'{table}: time runs backwards after {time[backward[0]]:g} s')


def _check_finite(table: Path, topic: str, quantity: str, values: Array) -> None:
    bad = ~np.isfinite(values).all(axis=1)
    if bad.any():
        raise NonFiniteError(
            f'{table}: {quantity} of {topic} is not finite in row {int(np.argmax(bad)) + 1} and '
            f'{int(bad.sum()) - 1} more'
        )

"""How the columns of a text table become topics: the mapping file of `endoscope convert`.

`EXAMPLE` shows a whole one and names every key.
"""

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_bags.errors import BagError
from endoscope_bags.units import TIME_UNITS, UNITS, known_unit
from endoscope_core.errors import FileError, nearest
from endoscope_core.strict_yaml import load_yaml

_TYPES = {str: 'a text', int: 'a whole number', bool: 'true or false'}
QUANTITIES = ('position', 'velocity', 'effort')
ANGLES = ('bend_x', 'bend_y', 'motor_x', 'motor_y')
NAMES = {
    'slave/servo_jp': ANGLES[:2],
    'motor/servo_jp': ANGLES,
    'motor/measured_js': ANGLES,
    'slave/measured_js': ANGLES[:2],
    'wires/measured_js': ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg'),
    'master/measured_js': ANGLES[:2],
}
"""Topics that the analysis knows, with the names of their joints and wires."""
# One letter left out of six, or another one among eleven.
_NEAR_MISS = 0.9
KEYS = (
    'time',
    'topics',
    'delimiter',
    'decimal_comma',
    'header_lines',
    'namespace',
    'start_s',
    'drop_repeats',
    'sample_and_hold',
    'incomplete_rows',
)
REFUSE, DROP = 'refuse', 'drop'
EXAMPLE = """\
time: {column: time, unit: ms}          # a column by its name or by its number, from 1
topics:                                 # what each topic takes from the table
  slave/servo_jp:                       # the desired angle (or motor/servo_jp: the shaft's)
    position: {bend_x: {column: "target [deg]", unit: deg}}
  motor/measured_js:
    position: {motor_x: {column: 3, unit: rad, scale: 0.5, offset: 0.1}}
  slave/measured_js:
    position: {bend_x: {column: angle}}          # no unit: the one in the table's heading, else SI
  wires/measured_js:
    effort: {wire_x_pos: {column: 5, unit: N}, wire_x_neg: {column: 6, unit: N}}
# All that follows may be left out.
delimiter: ';'          # one character, or whitespace; found from the table if left out
decimal_comma: true     # numbers such as 0,25; found if left out
header_lines: 2         # lines above the numbers; found if left out
namespace: /endoscope   # of the topics
start_s: 0.0            # added to every time
drop_repeats: true      # drop rows whose time is that of the row before
incomplete_rows: refuse # or drop: where a topic lacks a part of its numbers, or one is NaN
"""
"""A mapping with every key but `sample_and_hold`, which excludes `drop_repeats`."""
WHITESPACE = 'whitespace'
"""As a delimiter: one or more blanks or tabs."""

HELP = f"""\
A mapping file says what the columns are:

{EXAMPLE}
sample_and_hold: true   # in place of drop_repeats, for a table that was written faster than its
                        # sources gave new numbers: a topic has a message where one of its
                        # columns changes, at a time between that of the row and the next
Topics hold position, velocity or effort. Units of time are {', '.join(TIME_UNITS)}
(date: ISO 8601, such as 2026-01-31 13:45:00.250, or a time of day), other units
{', '.join(unit for unit in UNITS if unit not in TIME_UNITS)}.
The value is (number * scale + offset) in the unit. An empty cell is no sample.
"""


class TableMappingError(BagError, ValueError):
    """A mapping file that cannot be used; the message names the file and the key."""


@dataclass(frozen=True)
class Column:
    """One column of the table: `scale` times its number plus `offset` is the value in the unit."""

    source: int | str  # its number, from 1, or its name
    unit: str | None = None  # None for that of the table's heading
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class TableMapping:
    """A whole mapping file; what is None is to be found from the table."""

    time: Column
    topics: Mapping[str, Mapping[str, Mapping[str, Column]]]  # columns by topic, quantity and name
    delimiter: str | None = None  # one character or `whitespace`
    decimal_comma: bool | None = None
    header_lines: int | None = None
    namespace: str = '/endoscope'
    start_s: float = 0.0
    drop_repeats: bool = True
    # Rows of one time lie evenly between it and the next one, and a topic has a message where one
    # of its columns changes.
    sample_and_hold: bool = False
    # A topic has no message, instead of an error, where some of its cells are empty or not finite.
    drop_incomplete: bool = False


def load_table_mapping(path: str | Path) -> TableMapping:
    """Read a mapping file."""
    try:
        content = load_yaml(path)
    except FileError as error:
        raise TableMappingError(f'mapping: {error}') from error
    try:
        return _mapping(content)
    except ValueError as error:
        raise TableMappingError(f'{path}: {error}') from error


def _mapping(content: Any) -> TableMapping:
    given = _section(content, 'the mapping', KEYS)
    for key in ('time', 'topics'):
        if key not in given:
            raise ValueError(f'{key} is missing')
    topics = {
        topic: _topic(topic, quantities)
        for topic, quantities in _section(given['topics'], 'topics').items()
    }
    if not topics:
        raise ValueError('topics is empty')
    if 'drop_repeats' in given and given.get('sample_and_hold'):
        raise ValueError('drop_repeats has no meaning beside sample_and_hold: leave it out')
    delimiter = _of_type(str, given, 'delimiter', None)
    if delimiter not in (None, WHITESPACE) and len(delimiter) != 1:
        raise ValueError(f'delimiter is {delimiter!r}: give one character, or {WHITESPACE}')
    header_lines = _of_type(int, given, 'header_lines', None)
    if header_lines is not None and header_lines < 0:
        raise ValueError(f'header_lines is {header_lines}: give how many lines to skip')
    incomplete = given.get('incomplete_rows', REFUSE)
    if incomplete not in (REFUSE, DROP):
        raise ValueError(f'incomplete_rows is {incomplete!r}: give {REFUSE} or {DROP}')
    time = _column(given['time'], 'time')
    if time.unit is not None and time.unit not in TIME_UNITS:
        raise ValueError(f'time.unit is {time.unit!r}: valid are {", ".join(TIME_UNITS)}')
    return TableMapping(
        time,
        topics,
        delimiter,
        _of_type(bool, given, 'decimal_comma', None),
        header_lines,
        _of_type(str, given, 'namespace', '/endoscope').rstrip('/'),
        _number(given.get('start_s', 0.0), 'start_s'),
        _of_type(bool, given, 'drop_repeats', True),
        _of_type(bool, given, 'sample_and_hold', False),
        incomplete == DROP,
    )


def _of_type[Kind, Default](
    kind: type[Kind], given: Mapping[str, Any], key: str, default: Default
) -> Kind | Default:
    if key not in given:
        return default
    value = given[key]
    if type(value) is not kind:
        raise ValueError(f'{key} is {value!r}: give {_TYPES[kind]}')
    return value


def _topic(topic: str, content: Any) -> dict[str, dict[str, Column]]:
    where = f'topics.{topic}'
    _refuse_near_miss(topic, 'topics', NAMES)
    quantities = _section(content, where, QUANTITIES)
    read = {
        quantity: {
            name: _column(column, f'{where}.{quantity}.{name}')
            for name, column in _section(columns, f'{where}.{quantity}').items()
        }
        for quantity, columns in quantities.items()
    }
    for columns in read.values():
        for name in columns:
            _refuse_near_miss(name, where, NAMES.get(topic, ()))
    names = {tuple(columns) for columns in read.values()}
    if len(names) != 1 or not next(iter(names)):
        raise ValueError(f'{where}: every quantity must have the same joints in the same order')
    return read


def _refuse_near_miss(name: str, where: str, known: Collection[str]) -> None:
    """Other names than those that the analysis knows are kept, but not one that is misspelt."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=_NEAR_MISS)
    if near and name not in known:
        raise ValueError(f'unknown {name} in {where}: did you mean {near[0]}?')


def _column(content: Any, where: str) -> Column:
    given = _section(content, where, ('column', 'unit', 'scale', 'offset'))
    source = given.get('column')
    named = isinstance(source, str) and source.strip()
    numbered = isinstance(source, int) and not isinstance(source, bool) and source >= 1
    if not isinstance(source, int | str) or not (named or numbered):
        raise ValueError(
            f'{where}.column is {source!r}: give the number of a column, from 1, or its name'
        )
    unit = given.get('unit')
    if unit is not None:
        known = known_unit(unit) if isinstance(unit, str) and unit not in UNITS else unit
        if not isinstance(known, str):
            raise ValueError(f'{where}.unit is {unit!r}: valid are {", ".join(UNITS)}')
        unit = known
    if where != 'time' and unit in TIME_UNITS:
        raise ValueError(f'{where}.unit is {unit!r}, a unit of time')
    return Column(
        source,
        unit,
        _number(given.get('scale', 1.0), f'{where}.scale'),
        _number(given.get('offset', 0.0), f'{where}.offset'),
    )


def _section(value: Any, where: str, valid: tuple[str, ...] | None = None) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f'{where} must be a mapping of names to values, not {value!r}')
    for key in value:
        if not isinstance(key, str):
            raise ValueError(f'{key!r} in {where} is no name: put it in quotes')
        if valid is not None and key not in valid:
            raise ValueError(f'unknown key {key} in {where}: {nearest(key, valid)}')
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f'{where} is {value!r}: give a number')
    return float(value)

"""How the columns of a text table become topics: the mapping file of `endoscope convert`.

    time: {column: 1, unit: s}
    topics:
      slave/servo_jp:
        position: {bend_x: {column: 2, unit: deg}}
      wires/measured_js:
        effort: {wire_x_pos: {column: 5, unit: N}, wire_x_neg: {column: 6, unit: N}}

Further keys, all optional: `delimiter` (`,`, or `whitespace`), `header_lines` (lines to skip),
`namespace`, `start_s` (added to every time), `drop_repeats` (whether a row whose time is that of
the row before is dropped; true), `sample_and_hold` (whether the table was written faster than its
sources gave new numbers, and repeats old ones until then; false). A column may have a `scale`
(after the unit) and an `offset`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from endoscope_bags.errors import BagError
from endoscope_core.strict_yaml import YamlError, load_yaml

_TYPES = {str: 'a text', int: 'a whole number', bool: 'true or false'}
QUANTITIES = ('position', 'velocity', 'effort')
UNITS = {
    's': 1.0,
    'ms': 1e-3,
    'us': 1e-6,
    'rad': 1.0,
    'deg': math.pi / 180.0,
    'rad/s': 1.0,
    'deg/s': math.pi / 180.0,
    'N': 1.0,
    'mN': 1e-3,
    'N m': 1.0,
    'mN m': 1e-3,
    '-': 1.0,
}
"""SI value of one of each unit."""


class TableMappingError(BagError, ValueError):
    """A mapping file that cannot be used; the message names the file and the key."""


@dataclass(frozen=True)
class Column:
    """One column of the table.

    Attributes
    ----------
    number : int
        From 1.
    scale, offset : float
        `scale` times the number in the table plus `offset` is the SI value.
    """

    number: int
    scale: float
    offset: float


@dataclass(frozen=True)
class TableMapping:
    """A whole mapping file.

    Attributes
    ----------
    time : Column
    topics : mapping of topic to mapping of quantity to mapping of name to Column
    delimiter : str or None
        None for whitespace.
    header_lines : int
    namespace : str
    start_s : float
    drop_repeats : bool
    sample_and_hold : bool
        Rows of one time lie evenly between it and the next one, and a topic has a message where one
        of its columns changes.
    """

    time: Column
    topics: Mapping[str, Mapping[str, Mapping[str, Column]]]
    delimiter: str | None = ','
    header_lines: int = 0
    namespace: str = '/endoscope'
    start_s: float = 0.0
    drop_repeats: bool = True
    sample_and_hold: bool = False


def load_table_mapping(path: str | Path) -> TableMapping:
    """Read a mapping file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    TableMapping

    Raises
    ------
    TableMappingError
        If the file cannot be read, or a key is unknown, missing or has a wrong value.
    """
    try:
        content = load_yaml(path)
    except YamlError as error:
        raise TableMappingError(f'mapping: {error}') from error
    try:
        return _mapping(content)
    except ValueError as error:
        raise TableMappingError(f'{path}: {error}') from error


def _mapping(content: Any) -> TableMapping:
    given = _section(
        content,
        'the mapping',
        (
            'time',
            'topics',
            'delimiter',
            'header_lines',
            'namespace',
            'start_s',
            'drop_repeats',
            'sample_and_hold',
        ),
    )
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
    delimiter = _of_type(str, given, 'delimiter', ',')
    if delimiter != 'whitespace' and len(delimiter) != 1:
        raise ValueError(f'delimiter is {delimiter!r}: give one character, or whitespace')
    header_lines = _of_type(int, given, 'header_lines', 0)
    if header_lines < 0:
        raise ValueError(f'header_lines is {header_lines}: give how many lines to skip')
    return TableMapping(
        _column(given['time'], 'time'),
        topics,
        None if delimiter == 'whitespace' else delimiter,
        header_lines,
        _of_type(str, given, 'namespace', '/endoscope').rstrip('/'),
        _number(given.get('start_s', 0.0), 'start_s'),
        _of_type(bool, given, 'drop_repeats', True),
        _of_type(bool, given, 'sample_and_hold', False),
    )


def _of_type[Kind](kind: type[Kind], given: Mapping[str, Any], key: str, default: Kind) -> Kind:
    value = given.get(key, default)
    if type(value) is not kind:
        raise ValueError(f'{key} is {value!r}: give {_TYPES[kind]}')
    return value


def _topic(topic: str, content: Any) -> dict[str, dict[str, Column]]:
    where = f'topics.{topic}'
    quantities = _section(content, where, QUANTITIES)
    read = {
        quantity: {
            name: _column(column, f'{where}.{quantity}.{name}')
            for name, column in _section(columns, f'{where}.{quantity}').items()
        }
        for quantity, columns in quantities.items()
    }
    names = {tuple(columns) for columns in read.values()}
    if len(names) != 1 or not next(iter(names)):
        raise ValueError(f'{where}: every quantity must have the same joints in the same order')
    return read


def _column(content: Any, where: str) -> Column:
    given = _section(content, where, ('column', 'unit', 'scale', 'offset'))
    number = given.get('column')
    if isinstance(number, bool) or not isinstance(number, int) or number < 1:
        raise ValueError(f'{where}.column is {number!r}: give the number of a column, from 1')
    unit = str(given.get('unit', '-'))
    if unit not in UNITS:
        raise ValueError(f'{where}.unit is {unit!r}: valid are {", ".join(UNITS)}')
    scale = _number(given.get('scale', 1.0), f'{where}.scale')
    offset = _number(given.get('offset', 0.0), f'{where}.offset')
    return Column(number, UNITS[unit] * scale, UNITS[unit] * offset)


def _section(value: Any, where: str, valid: tuple[str, ...] | None = None) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ValueError(f'{where} must be a mapping of names to values, not {value!r}')
    for key in value:
        if not isinstance(key, str):
            raise ValueError(f'{key!r} in {where} is no name: put it in quotes')
        if valid is not None and key not in valid:
            raise ValueError(f'unknown key {key} in {where}: valid are {", ".join(valid)}')
    return value


def _number(value: Any, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f'{where} is {value!r}: give a number')
    return float(value)

"""How the columns of a text table become topics: the mapping file of `endoscope convert`.

`EXAMPLE` shows a whole one and names every key.
"""

import difflib
import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from msgspec import Meta

from endoscope_core.schema import Before, load, one_of, within

DATE = 'date'
"""In place of a unit: the column holds dates and times, or times of day (ISO 8601)."""
UNITS = {
    's': 1.0,
    'ms': 1e-3,
    'us': 1e-6,
    'ns': 1e-9,
    DATE: 1.0,
    'rad': 1.0,
    'mrad': 1e-3,
    'deg': math.pi / 180.0,
    'turn': 2.0 * math.pi,
    'rad/s': 1.0,
    'deg/s': math.pi / 180.0,
    'rpm': math.pi / 30.0,
    'm': 1.0,
    'mm': 1e-3,
    'N': 1.0,
    'mN': 1e-3,
    'kN': 1e3,
    'N m': 1.0,
    'mN m': 1e-3,
    '-': 1.0,
}
"""SI value of one of each unit."""
TIME_UNITS = ('s', 'ms', 'us', 'ns', DATE)
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
EXAMPLE = """\
time: {column: time, unit: ms}          # a column by its name or by its number, from 1
topics:                                 # what each topic takes from the table
  slave/servo_jp:                       # the desired angle (or motor/servo_jp: the shaft's)
    position: {bend_x: {column: "target [deg]", unit: deg}}
  motor/measured_js:
    position: {motor_x: {column: 3, unit: rad, scale: 0.5, offset: 0.1}}
  slave/measured_js:
    position: {bend_x: {column: angle}}          # no unit: SI
  wires/measured_js:
    effort: {wire_x_pos: {column: 5, unit: N}, wire_x_neg: {column: 6, unit: N}}
# All that follows may be left out.
delimiter: ';'          # one character, or whitespace; looked for if left out
decimal_comma: true     # numbers such as 0,25
header_lines: 2         # lines above the numbers, of which the last names the columns
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
                        # columns changes, at a time between that of the row and the next,
                        and where its source rests at the interval that it had
Topics hold position, velocity or effort. Units of time are {', '.join(TIME_UNITS)}
(date: ISO 8601, such as 2026-01-31 13:45:00.250, or a time of day), other units
{', '.join(unit for unit in UNITS if unit not in TIME_UNITS)}.
The value is (number * scale + offset) in the unit. An empty cell is no sample.
"""
_DELIMITER = Meta(
    pattern=rf'(?s)^(?:.|{WHITESPACE})\Z', description=f'one character, or {WHITESPACE}'
)
_VALUE_UNIT = one_of(unit for unit in UNITS if unit not in TIME_UNITS)


def _without_slash(value: Any) -> Any:
    return value.rstrip('/') if isinstance(value, str) else value


@dataclass(frozen=True)
class Column:
    """One column of the table: `scale` times its number plus `offset` is the value in the unit."""

    column: Annotated[
        Annotated[int, Meta(ge=1)] | Annotated[str, Meta(pattern=r'\S')],
        Meta(description='the number of a column, from 1, or its name'),
    ]
    unit: Annotated[str, _VALUE_UNIT] = '-'  # already SI
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class TimeColumn(Column):
    """The column of times."""

    unit: Annotated[str, one_of(TIME_UNITS)] = 's'


@dataclass(frozen=True)
class TableMapping:
    """A whole mapping file."""

    time: TimeColumn
    # Columns by topic, quantity and name.
    topics: Mapping[str, Mapping[Literal[QUANTITIES], Mapping[str, Column]]]  # type: ignore[valid-type]
    delimiter: Annotated[str, _DELIMITER] | None = None
    decimal_comma: bool = False
    header_lines: Annotated[int, within(0)] | None = None
    namespace: Annotated[str, Before(_without_slash)] = '/endoscope'
    start_s: float = 0.0
    drop_repeats: bool | None = None  # None: unless sampled and held
    # Rows of one time lie evenly between it and the next one, and a topic has a message where one
    # of its columns changes.
    sample_and_hold: bool = False
    # drop: a topic has no message, instead of an error, where some of its cells are empty or not
    # finite.
    incomplete_rows: Literal['refuse', 'drop'] = 'refuse'

    def __post_init__(self) -> None:
        if not self.topics:
            raise ValueError('topics is empty: give the columns of one at least')
        if self.sample_and_hold and self.drop_repeats is not None:
            raise ValueError('drop_repeats has no meaning beside sample_and_hold: leave it out')
        for topic, quantities in self.topics.items():
            _refuse_near_miss(topic, 'topics', NAMES)
            for columns in quantities.values():
                for name in columns:
                    _refuse_near_miss(name, f'topics.{topic}', NAMES.get(topic, ()))
            names = {tuple(columns) for columns in quantities.values()}
            if len(names) != 1 or not next(iter(names)):
                raise ValueError(
                    f'topics.{topic}: every quantity must have the same joints in the same order'
                )


def load_table_mapping(path: str | Path) -> TableMapping:
    """Read a mapping file; a FileError names the file and the key."""
    return load(TableMapping, path, 'mapping')


def _refuse_near_miss(name: str, where: str, known: Collection[str]) -> None:
    """Other names than those that the analysis knows are kept, but not one that is misspelt."""
    near = difflib.get_close_matches(name, known, n=1, cutoff=_NEAR_MISS)
    if near and name not in known:
        raise ValueError(f'unknown {name} in {where}: did you mean {near[0]}?')

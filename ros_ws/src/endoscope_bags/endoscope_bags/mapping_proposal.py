"""What the columns of an unknown table probably are, as a mapping for a person to check."""

import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_bags.delimited_text import DelimitedText, is_date
from endoscope_bags.table_mapping import DATE, TIME_UNITS, UNITS, WHITESPACE
from endoscope_core.errors import printable

DESIRED, SHAFT = 'slave/servo_jp', 'motor/servo_jp'
MOTOR, WIRES, BENDING = 'motor/measured_js', 'wires/measured_js', 'slave/measured_js'
_JOINTS = {
    DESIRED: ('bend_x', 'bend_y'),
    SHAFT: ('motor_x', 'motor_y'),
    MOTOR: ('motor_x', 'motor_y'),
    WIRES: ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg'),
    BENDING: ('bend_x', 'bend_y'),
}
_TIME = re.compile(r'(t|time|zeit|stamp|timestamps?|times?|date|datetime|clock|elapsed)')
_COMMAND = re.compile(r'cmd|command|desired|target|goal|setpoint|reference|\bref\b|soll|demand')
_MOTOR = re.compile(r'motor|shaft|encoder|servo|spool|pulley')
_WIRE = re.compile(r'tension|force|load ?cell|wire|cable|tendon|newton|kraft')
_RATE = re.compile(r'vel|speed|omega|rate')
_TORQUE = re.compile(r'torque|moment|effort')
_ANGLE = re.compile(r'angle|bend|pos|deg|theta|phi|tip|joint|measured|actual|tracker|winkel|\bq\b')
_NEGATIVE = re.compile(r'neg|minus|right|\b2\b|_b\b|-')
_Y = re.compile(r'\by\b|_y|y_|pitch')
# Numbers beyond two turns are no radians of a joint.
_MOST_RAD = 4.0 * np.pi
# And these are no degrees: counts of an encoder perhaps.
_MOST_DEG = 720.0
# Since 1973 in these many of the unit, until far beyond any recording.
_EPOCH = ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'), (1e8, 's'))


@dataclass(frozen=True)
class ColumnGuess:
    """What a column holds and what it is taken for."""

    number: int  # from 1
    title: str  # as in the table; empty where it has none
    low: float | None  # None, like `high` and `step`, for dates and for what is no number
    high: float | None
    step: float | None  # median change from row to row
    first: str  # the first cell
    role: str | None = None  # `time`, or `TOPIC QUANTITY JOINT`; None where nothing fits
    unit: str | None = None
    why: str = ''

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return dict(vars(self))


@dataclass(frozen=True)
class Proposal:
    """Guesses for all columns of a table."""

    table: str
    rows: int
    separator: str
    decimal_comma: bool
    first_line: int  # of the first row of numbers
    columns: tuple[ColumnGuess, ...]

    def as_json(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {**vars(self), 'columns': [column.as_json() for column in self.columns]}

    def __str__(self) -> str:
        comma = ', decimal comma' if self.decimal_comma else ''
        named = {'\t': 'tab', ' ': 'blank', WHITESPACE: 'blanks'}.get(
            self.separator, self.separator
        )
        head = ('column', 'name', 'range', 'step', 'taken for', 'unit', 'because')
        rows = [head, *map(_row, self.columns)]
        widths = [max(len(row[k]) for row in rows) for k in range(len(head))]
        lines = [
            (
                f'{self.table}: {self.rows} rows from line {self.first_line}, separated by '
                f'{named}{comma}'
            ),
            *('  '.join(c.ljust(w) for c, w in zip(row, widths, strict=True)) for row in rows),
        ]
        return '\n'.join(printable(line.rstrip()) for line in lines)

    def mapping(self) -> str:
        """Return the guesses as the text of a mapping file, with what is doubtful as comments."""
        return '\n'.join(printable(line) for line in self._mapping_lines()) + '\n'

    def _mapping_lines(self) -> Iterator[str]:
        yield f'# Proposed for {self.table}: every line is a guess. Check it, then give it to'
        yield '# `endoscope convert TABLE --mapping THIS --out BAG` (its --help has all keys).'
        found = {column.role: column for column in self.columns if column.role}
        time = found.pop('time', None)
        if time is None:
            yield '# No column looks like the time. Name it:'
            yield '# time: {column: 1, unit: s}'
        else:
            yield f'time: {self._source(time)}{_because(time)}'
        topics: dict[str, dict[str, list[ColumnGuess]]] = {}
        for role, column in found.items():
            topic, quantity, _ = role.split()
            topics.setdefault(topic, {}).setdefault(quantity, []).append(column)
        if topics:
            yield 'topics:'
        else:
            yield '# No column was recognised. Such as:'
            yield '# topics:'
            yield f'#   {DESIRED}:'
            yield '#     position: {bend_x: {column: 2, unit: deg}}'
        for topic, quantities in topics.items():
            yield f'  {topic}:'
            for quantity, columns in quantities.items():
                yield f'    {quantity}:'
                for column in columns:
                    joint = str(column.role).split()[2]
                    yield f'      {joint}: {self._source(column)}{_because(column)}'
        unused = [column for column in self.columns if column.role is None]
        if unused:
            yield '# Not used:'
        for column in unused:
            yield f'#   column {column.number} {column.title}'.rstrip() + f' ({_range(column)})'

    def _source(self, column: ColumnGuess) -> str:
        alike = sum(each.title == column.title for each in self.columns)
        plain = column.title and column.title.isprintable() and alike == 1
        name = json.dumps(column.title, ensure_ascii=False) if plain else str(column.number)
        unit = f', unit: {column.unit}' if column.unit in UNITS else ''
        return f'{{column: {name}{unit}}}'


def propose_mapping(text: DelimitedText) -> Proposal:
    """Guess what columns are by name, range and step; none is taken for two things."""
    width = min(len(row) for row in text.rows)
    columns = [_described(text, index) for index in range(width)]
    time = _time_column(text, columns)
    taken: set[str] = set()
    guessed = []
    for column in columns:
        if column is time:
            guessed.append(_as_time(text, column))
        else:
            guess = _as_joint(text, column, taken)
            taken |= {guess.role} if guess.role else set()
            guessed.append(guess)
    return Proposal(
        str(text.path),
        len(text.rows),
        text.separator,
        text.decimal_comma,
        text.lines[0],
        tuple(_of_like_quantities(guessed)),
    )


def _described(text: DelimitedText, index: int) -> ColumnGuess:
    cells = text.cells(index)
    first = next((cell for cell in cells if cell), '')
    title = text.headings[index].title if index < len(text.headings) else ''
    filled = [cell.replace(',', '.') if text.decimal_comma else cell for cell in cells if cell]
    try:
        numbers = np.array([float(cell) for cell in filled])
    except ValueError:
        return ColumnGuess(index + 1, title, None, None, None, first)
    if not len(numbers) or not np.isfinite(numbers).all():
        return ColumnGuess(index + 1, title, None, None, None, first)
    with np.errstate(over='ignore'):
        step = float(np.median(np.abs(np.diff(numbers)))) if len(numbers) > 1 else 0.0
    return ColumnGuess(index + 1, title, float(numbers.min()), float(numbers.max()), step, first)


def _time_column(text: DelimitedText, columns: Sequence[ColumnGuess]) -> ColumnGuess | None:
    rising = [column for column in columns if _rises(text, column)]
    named = [column for column in rising if _TIME.fullmatch(_words(text, column).split(' ')[0])]
    dated = [column for column in rising if column.step is None]
    return next(iter([*named, *dated, *rising]), None)


def _rises(text: DelimitedText, column: ColumnGuess) -> bool:
    cells = text.cells(column.number - 1)
    times: NDArray[Any]
    if column.low is None:
        if not all(map(is_date, cells)):
            return False
        times = text.dates(column.number - 1)
    else:
        times, empty = text.numbers(column.number - 1)
        if empty.any():
            return False
    return bool((np.diff(times) >= 0).all() and times[-1] > times[0])


def _as_time(text: DelimitedText, column: ColumnGuess) -> ColumnGuess:
    heading = text.headings[column.number - 1]
    named = bool(_TIME.fullmatch(_words(text, column).split(' ')[0]))
    why = 'its name, and it never falls' if named else 'it never falls'
    if column.low is None or column.high is None or column.step is None:
        return _guess(column, 'time', DATE, 'its cells are dates and times')
    if heading.unit in TIME_UNITS:
        return _guess(column, 'time', heading.unit, f'{why}; the unit is in its heading')
    for least, unit in _EPOCH:
        if column.low >= least:
            return _guess(column, 'time', unit, f'{why}; counted since 1970')
    # No recorder samples slower than once in a few seconds or faster than 100 kHz.
    unit = 's' if column.step < 2.0 else 'ms' if column.step < 2000.0 else 'us'
    return _guess(column, 'time', unit, f'{why}; the unit by its step')


def _words(text: DelimitedText, column: ColumnGuess) -> str:
    name = text.headings[column.number - 1].name if text.headings else ''
    return ' '.join(re.sub(r'(?<=[a-z])(?=[A-Z])', ' ', name).replace('_', ' ').lower().split())


def _as_joint(text: DelimitedText, column: ColumnGuess, taken: set[str]) -> ColumnGuess:
    heading = text.headings[column.number - 1]
    name = _words(text, column)
    if not name or column.low is None or column.high is None:
        return column
    if column.low == column.high:
        return _guess(column, None, None, 'it never changes')
    place = _topic_and_quantity(name, heading.unit)
    if place is None:
        return column
    topic, quantity = place
    joints = _JOINTS[topic]
    preferred = len(joints) // 2 if _Y.search(name) else 0
    if topic == WIRES and _NEGATIVE.search(name):
        preferred += 1
    for joint in dict.fromkeys((joints[preferred], *joints[preferred:])):
        role = f'{topic} {quantity} {joint}'
        if role not in taken:
            unit, by = _unit(column, quantity, topic, heading.unit)
            return _guess(column, role, unit, f'its name; {by}')
    return _guess(column, None, None, f'{topic} has its {quantity} already')


def _topic_and_quantity(name: str, unit: str | None) -> tuple[str, str] | None:
    quantity = 'position'
    if unit in ('rad/s', 'deg/s', 'rpm') or _RATE.search(name):
        quantity = 'velocity'
    elif unit in ('N m', 'mN m') or _TORQUE.search(name):
        quantity = 'effort'
    if unit in ('N', 'mN', 'kN') or (
        unit is None and _WIRE.search(name) and quantity != 'velocity'
    ):
        return WIRES, 'effort'
    if _COMMAND.search(name):
        return (SHAFT if _MOTOR.search(name) else DESIRED), quantity
    if _MOTOR.search(name):
        return MOTOR, quantity
    if quantity != 'effort' and (_ANGLE.search(name) or unit in ('rad', 'mrad', 'deg', 'turn')):
        return BENDING, quantity
    return None


def _unit(
    column: ColumnGuess, quantity: str, topic: str, heading: str | None
) -> tuple[str | None, str]:
    if heading is not None:
        return heading, 'the unit is in its heading'
    if quantity == 'effort':
        return ('N' if topic == WIRES else 'N m'), 'the unit is assumed'
    largest = max(abs(column.low or 0.0), abs(column.high or 0.0))
    if largest > _MOST_DEG:
        return None, 'no angle has its range: give unit and scale'
    unit = 'deg' if largest > _MOST_RAD else 'rad'
    return (unit if quantity == 'position' else f'{unit}/s'), 'the unit by its range'


def _of_like_quantities(guesses: Sequence[ColumnGuess]) -> Iterator[ColumnGuess]:
    """Drop from a topic a quantity that has other joints than its position, which none may have."""
    joints: dict[tuple[str, str], list[str]] = {}
    for guess in guesses:
        if guess.role and guess.role != 'time':
            topic, quantity, joint = guess.role.split()
            joints.setdefault((topic, quantity), []).append(joint)
    leading: dict[str, str] = {}
    for topic, quantity in joints:
        leading.setdefault(topic, 'position' if (topic, 'position') in joints else quantity)
    for guess in guesses:
        if guess.role and guess.role != 'time':
            topic, quantity, _ = guess.role.split()
            if joints[topic, quantity] != joints[topic, leading[topic]]:
                guess = _guess(guess, None, None, f'{topic} has other joints')
        yield guess


def _guess(column: ColumnGuess, role: str | None, unit: str | None, why: str) -> ColumnGuess:
    return ColumnGuess(**{**vars(column), 'role': role, 'unit': unit, 'why': why})


def _range(column: ColumnGuess) -> str:
    if column.low is None:
        return f'{column.first[:30]} ...'
    return f'{column.low:.6g} to {column.high:.6g}'


def _row(column: ColumnGuess) -> tuple[str, ...]:
    step = '-' if column.step is None else f'{column.step:.4g}'
    return (
        str(column.number),
        column.title or '-',
        _range(column),
        step,
        column.role or '-',
        column.unit or '-',
        column.why or 'nothing fits',
    )


def _because(column: ColumnGuess) -> str:
    return f'  # {column.why}; {_range(column)}'

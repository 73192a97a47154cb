"""Units in which tables are written, and how people spell them."""

import math

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
UNIT_SPELLINGS = {
    **{unit: unit for unit in UNITS if unit not in ('-', DATE)},
    'sec': 's',
    'second': 's',
    'seconds': 's',
    'msec': 'ms',
    'millis': 'ms',
    'milliseconds': 'ms',
    'µs': 'us',
    'usec': 'us',
    'micros': 'us',
    'microseconds': 'us',
    'nsec': 'ns',
    'nanos': 'ns',
    'nanoseconds': 'ns',
    'radian': 'rad',
    'radians': 'rad',
    '°': 'deg',
    'degree': 'deg',
    'degrees': 'deg',
    'turns': 'turn',
    'rev': 'turn',
    '1/min': 'rpm',
    '°/s': 'deg/s',
    'dps': 'deg/s',
    'newton': 'N',
    'newtons': 'N',
    'Nm': 'N m',
    'N·m': 'N m',
    'N*m': 'N m',
    'mNm': 'mN m',
}
"""By spelling; what is not found as it is written is looked for in lower case."""


def known_unit(text: str) -> str | None:
    """Return a unit as `UNITS` has it, however it is spelled; None for what is none."""
    text = text.strip().replace('μ', 'µ')
    return UNIT_SPELLINGS.get(text) or UNIT_SPELLINGS.get(text.casefold())

"""Units, signs and orders that people take by mistake."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations
from math import log, pi

from endoscope_bags.table_mapping import UNITS
from endoscope_core.physics.description import PlantDescription

LARGE = 5.0
"""Factor that no gear of this rig has, nor a servo that misses its command."""
OTHER_RIGS = 4.0
"""Factor by which a description may be wrong, either way: forces of another rig may all be so many
times as large, and nothing tells that from cells that read so many times too much."""
STANDARD_GRAVITY = 9.80665
KINDS = 6 * 4
"""Of mistakes: unit, sign, order and factor of the command and of five measured quantities."""
CONVERTER_BITS = 24
"""Of the finest converter whose counts anybody records."""


@dataclass(frozen=True)
class Misreading:
    """One way in which the columns of a quantity may be meant."""

    quantity: str  # series of a `Recording`
    kind: str  # `right`, `unit`, `sign`, `order` or `factor`, which is no unit known
    price: float  # logarithm of how many mistakes are as likely as this one; 0 for what is right
    source: tuple[int, ...]  # measured column that holds each signal
    factor: tuple[float, ...]  # reading of one SI unit in each measured column
    unit: str = ''  # in words

    @property
    def touched(self) -> tuple[int, ...]:
        """Columns that are read otherwise than they are named."""
        return tuple(
            c
            for c, (s, f) in enumerate(zip(self.source, self.factor, strict=True))
            if (s, f) != (c, 1.0)
        )

    @property
    def of_gear(self) -> bool:
        """Whether the same mistake in command and shaft could be physics as well."""
        return self.kind == 'factor' or (
            self.kind == 'unit' and max(self.factor) < LARGE and min(self.factor) > 1.0 / LARGE
        )


def known_units(quantity: str, plant: PlantDescription, gear: float) -> dict[str, float]:
    """Return what people give in place of SI, and the reading of one SI unit in each."""
    degrees = 1.0 / UNITS['deg']
    radius = next(iter(plant.joints.values())).pulley_radius
    of_motor = {
        'deg': degrees,
        'mrad': 1.0 / UNITS['mrad'],
        'turns': 1.0 / UNITS['turn'],
        'counts of the encoder': plant.sensors.encoder_counts / (2.0 * pi),
        'rad, converted from degrees twice': UNITS['deg'],
        'radians of the bending joint': 1.0 / gear,
        'radians of the shaft, divided by the gear once more': gear,
        'mm of wire': 1e3 * radius,
    }
    return {
        'command': of_motor,
        'shaft_position': of_motor,
        'shaft_velocity': {'deg/s': degrees, 'rpm': 1.0 / UNITS['rpm']},
        'shaft_effort': {'mN m': 1.0 / UNITS['mN m']},
        'tension': {
            'mN': 1.0 / UNITS['mN'],
            'g (gram-force)': 1e3 / STANDARD_GRAVITY,
            'kg (kilogram-force)': 1.0 / STANDARD_GRAVITY,
            'kN': 1.0 / UNITS['kN'],
        },
        'bending': {'deg': degrees, 'mrad': 1.0 / UNITS['mrad']},
    }[quantity]


def misreadings(
    quantity: str, plant: PlantDescription, gear: float, columns: int
) -> Iterator[Misreading]:
    """Ways to read the columns of a quantity or of the command, the right one first."""
    whole = tuple(range(columns))
    yield Misreading(quantity, 'right', 0.0, whole, (1.0,) * columns)
    units = known_units(quantity, plant, gear)
    for part, parts in _parts(columns, len(plant.joints)):
        for unit, factor in units.items():
            if len(part) * len(plant.joints) >= columns:
                yield scaled(quantity, 'unit', factor, part, columns, len(units) * parts, unit)
        yield scaled(quantity, 'sign', -1.0, part, columns, parts)
    orders = [order for order in permutations(whole) if order != whole]
    for order in orders:
        price = log(KINDS * len(orders))
        yield Misreading(quantity, 'order', price, order, (1.0,) * columns)


def scaled(
    quantity: str,
    kind: str,
    factor: float,
    part: Sequence[int],
    columns: int,
    ways: float,
    unit: str = '',
) -> Misreading:
    """A misreading of some columns by one factor, one of several ways to take them wrongly."""
    factors = tuple(factor if c in part else 1.0 for c in range(columns))
    price = log(KINDS * ways)
    return Misreading(quantity, kind, price, tuple(range(columns)), factors, unit)


def _parts(columns: int, joints: int) -> list[tuple[tuple[int, ...], int]]:
    """Columns that are taken wrongly together, with the number of parts that are as likely."""
    per_joint = columns // joints
    found: dict[tuple[int, ...], int] = {}
    extents = dict.fromkeys((columns, per_joint, 1))
    for extent in extents:
        for first in range(0, columns, extent):
            found[tuple(range(first, first + extent))] = len(extents) * columns // extent
    return list(found.items())

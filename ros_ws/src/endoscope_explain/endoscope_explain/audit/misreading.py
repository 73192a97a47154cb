"""Units, signs and orders that people take by mistake, and how each is said."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from math import log, pi

import numpy as np

from endoscope_bags.table_mapping import UNITS
from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.recording import (
    DESIRED,
    QUANTITY_UNITS,
    Array,
    Recording,
    motor_name,
    signal_name,
)

LARGE = 5.0
"""Factor that no gear of this rig has, nor a servo that misses its command."""
OTHER_RIGS = 4.0
"""Factor by which a description may be wrong, either way: forces of another rig may all be so many
times as large, and nothing tells that from cells that read so many times too much."""
STANDARD_GRAVITY = 9.80665
GEAR = 'radians of the bending joint'
COUNTS = 'counts of the encoder'
KINDS = 6 * 4
"""Of mistakes: unit, sign, order and factor of the command and of five measured quantities."""
CONVERTER_BITS = 24
"""Of the finest converter whose counts anybody records."""

Shares = Mapping[str, Array]
"""By quantity, of each column: what no lag, offset and scale make of the simulated one."""


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
        COUNTS: plant.sensors.encoder_counts / (2.0 * pi),
        'rad, converted from degrees twice': UNITS['deg'],
        GEAR: 1.0 / gear,
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


def as_findings(
    recording: Recording, mistakes: Sequence[Misreading], before: Shares, after: Shares
) -> list[Finding]:
    """Say each mistake in one line, with the misfits before and after all are put right."""
    # An exchange of motors is said once.
    findings: dict[tuple[str, str, tuple[int, ...]], Finding] = {}
    for mistake in mistakes:
        misfits = _misfit(mistake, before), _misfit(mistake, after)
        finding = _finding(recording, mistake, *misfits)
        topic = finding.signals[0].partition(':')[0]
        key = (topic, mistake.kind if mistake.kind == 'order' else mistake.quantity, mistake.source)
        findings.setdefault(key, finding)
    return list(findings.values())


def column_name(recording: Recording, quantity: str, column: int) -> str:
    """Return the name of a column of a quantity or of the command."""
    if quantity == 'command':
        joint = recording.joints[column]
        name = joint if recording.command.topic == DESIRED else motor_name(joint)
        return f'{recording.command.topic}:{name}'
    if quantity == 'tension':
        return signal_name(quantity, recording.joints[column // 2], column % 2)
    return signal_name(quantity, recording.joints[column])


def unlike_the_plant(recording: Recording, columns: Sequence[tuple[str, int]]) -> Finding:
    """Note signals that nothing known turns into what the plant gives."""
    signals = tuple(column_name(recording, *each) for each in columns)
    has, fits = ('has', 'it') if len(signals) == 1 else ('have', 'them')
    quantity, column = columns[0]
    return Finding(
        'unlike_the_plant',
        Severity.NOTE,
        recording.joints[column // (2 if quantity == 'tension' else 1)],
        'recording',
        signals,
        ((0.0, recording.duration),),
        f'{" and ".join(signals)} {has} nothing in common with what the plant gives, and no unit, '
        f'sign or order that is known makes {fits} fit',
        'fitted as recorded',
    )


def _misfit(mistake: Misreading, shares: Shares) -> float:
    """Share (rms) of what a mistake spoils: of a wrong command, all that was measured."""
    if mistake.quantity == 'command':
        spoilt = np.concatenate(list(shares.values()))
    else:
        spoilt = shares[mistake.quantity][list(mistake.touched)]
    return float(np.sqrt(np.mean(np.minimum(spoilt, 1.0) ** 2)))


def _finding(recording: Recording, mistake: Misreading, before: float, after: float) -> Finding:
    quantity = mistake.quantity
    signals = tuple(column_name(recording, quantity, c) for c in mistake.touched)
    named = ' and '.join(signals)
    verb = 'is' if len(signals) == 1 else 'are'
    wanted = QUANTITY_UNITS.get(quantity, 'rad')
    factor = next((f for f in mistake.factor if f != 1.0), 1.0)
    per_joint = 2 if quantity == 'tension' else 1
    evidence = {'misfit': before, 'misfit_corrected': after}
    gear_of_shaft = mistake.of_gear and quantity == 'shaft_position'
    if mistake.kind == 'unit' and not gear_of_shaft:
        times = f'{factor:.3g} times' if factor > 1.0 else f'1/{1.0 / factor:.3g} of'
        name = 'wrong_unit'
        text = f'{named} {verb} {times} what the plant can give: in {mistake.unit}, not in {wanted}'
        remedy = f'divide by {factor:.6g}, or give the unit when the table is converted'
        evidence['factor'] = factor
    elif mistake.kind == 'factor' and not gear_of_shaft:
        name = 'wrong_unit'
        text = (
            f'{named} {verb} about {factor:.2g} times what the plant can give, which is not a unit '
            'of force: counts of a converter, not N'
        )
        remedy = 'give what one count is in N as scale when the table is converted'
        evidence['factor'] = factor
    elif gear_of_shaft:
        name = 'wrong_gear'
        text = (
            f'{named} {"turns" if len(signals) == 1 else "turn"} {factor:.3g} times as far as '
            f'commanded by {recording.command.topic}: a gear is wrong on the way of one of them'
        )
        remedy = f'divide the position or multiply the command by {factor:.4g}, whichever is wrong'
        evidence['factor'] = factor
    elif mistake.kind == 'sign':
        name = 'wrong_sign'
        negated = 'it fits' if len(signals) == 1 else 'they fit'
        text = f'{named} {verb} of the wrong sign: negated, {negated} the plant'
        remedy = 'multiply by -1'
    else:
        name = 'exchanged'
        text = f'{named} are exchanged: ' + ', '.join(
            f'{column_name(recording, quantity, mistake.source[c]).rpartition(":")[2]} holds '
            f'{column_name(recording, quantity, c).rpartition(":")[2]}'
            for c in mistake.touched
        )
        remedy = 'exchange their names, or the plugs'
    return Finding(
        name,
        Severity.MISTAKE,
        recording.joints[mistake.touched[0] // per_joint],
        _stage(mistake),
        signals,
        ((0.0, recording.duration),),
        f'{text} (misfit {100 * before:.3g} % as recorded, {100 * after:.3g} % as corrected)',
        remedy,
        evidence=evidence,
    )


def _stage(mistake: Misreading) -> str:
    """The part of the chain that somebody has touched: plugs and signs are of a device."""
    if mistake.kind not in ('sign', 'order'):
        return 'recording'
    return 'sensing' if mistake.quantity in ('tension', 'bending') else 'actuator'

"""The family of tubes: one rig, and what bending its tube changes, from recordings of a real one.

What belongs to the rig is one number for all tubes. What the bend of the tube changes is a line or
a parabola over the bend; of positive quantities it is the logarithm that has this form, since
friction and stiffness grow by factors (Euler's capstan equation).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import yaml
from msgspec import Meta

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import InputError, nearest
from endoscope_core.physics.description import NUMBERS, JointParameters
from endoscope_core.physics.layout import NOMINAL_KEYS
from endoscope_core.schema import Number, load

SHIPPED = Path(__file__).with_name('family.yaml')
CENTRE = math.radians(120.0)
"""Bend at which a line takes its first number."""
SPAN = math.radians(120.0)
"""Bend over which a line grows by its second number."""
MOST_BENT = math.radians(300.0)
"""The tubes recorded were bent by 0 to 240 deg; a line says little far beyond them."""
SIGNED = tuple(key for key in NOMINAL_KEYS if NUMBERS[key].low < 0.0)
"""Keys that follow their line themselves; the logarithm of every other key does."""
_MOST_TERMS = 3
_DIGITS = 6


@dataclass(frozen=True)
class ReadingErrors:
    """How the recorded rig reads its plant."""

    # Of each cell without tension, N.
    load_cell_offset: Annotated[
        tuple[Number, Number],
        Meta(description='two numbers, of the positive and negative wire'),
    ] = (0.0, 0.0)
    load_cell_delay: Number = 0.0  # by how much tensions are recorded late, s
    tracker_delay: Number = 0.0  # by how much the angle is recorded late, s


@dataclass(frozen=True)
class TubeFamily:
    """Joints of one rig over the bend of its tube; a ValueError if a line is not valid."""

    # Of a nominal key: its value at `CENTRE`, then by how much it, or its logarithm, grows with the
    # bend and with its square, counted in `SPAN` from `CENTRE`. Keys left out are nominal.
    lines: Mapping[str, tuple[float, ...]]
    friction_profile: tuple[float, ...] = ()  # of all tubes
    readings: ReadingErrors = field(default_factory=ReadingErrors)
    # Where the numbers are from and what they leave; carried along, not used.
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for key, line in self.lines.items():
            if key not in NOMINAL_KEYS:
                raise ValueError(f'unknown key {key}: {nearest(key, NOMINAL_KEYS)}')
            if not 1 <= len(line) <= _MOST_TERMS or not np.all(np.isfinite(line)):
                raise ValueError(f'{key} is {list(line)}: give 1 to {_MOST_TERMS} finite numbers')
            if key not in SIGNED and line[0] <= 0.0:
                raise ValueError(f'{key} is {line[0]} at the centre: it must be positive')

    def joint(self, bend: float) -> JointParameters:
        """The joint of a tube bent by `bend` rad; an InputError outside of 0 to `MOST_BENT`."""
        if not 0.0 <= bend <= MOST_BENT:
            raise InputError(
                f'a tube bent by {math.degrees(bend):.0f} deg: the family reaches from 0 to '
                f'{math.degrees(MOST_BENT):.0f} deg'
            )
        z = (bend - CENTRE) / SPAN
        values: dict[str, Any] = {}
        for key, (middle, *growth) in self.lines.items():
            grown = sum(g * z ** (power + 1) for power, g in enumerate(growth))
            values[key] = middle + grown if key in SIGNED else middle * math.exp(grown)
        try:
            return JointParameters(friction_profile=self.friction_profile, **values)
        except ValueError as error:
            raise InputError(f'tube bent by {math.degrees(bend):.0f} deg: {error}') from error

    def save(self, path: str | Path) -> None:
        """Write the family as YAML."""
        content = {
            'schema': 1,
            'provenance': dict(self.provenance),
            'readings': {
                key: _rounded(value) for key, value in dataclasses.asdict(self.readings).items()
            },
            'friction_profile': _rounded(self.friction_profile),
            'lines': {key: _rounded(line) for key, line in self.lines.items()},
        }
        text = yaml.safe_dump(content, sort_keys=False, width=100, default_flow_style=None)
        write_text(path, text)


def load_family(path: str | Path = SHIPPED) -> TubeFamily:
    """Read a family; a FileError names the file and the key at fault."""
    return load(_File, path, 'family of tubes').family()


@cache
def shipped_family() -> TubeFamily:
    """The family that comes with the project."""
    return load_family()


@dataclass(frozen=True)
class _File:
    schema: Literal[1]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    readings: ReadingErrors = field(default_factory=ReadingErrors)
    friction_profile: tuple[Number, ...] = ()
    lines: Mapping[Literal[NOMINAL_KEYS], tuple[Number, ...]] = (  # type: ignore[valid-type]
        field(default_factory=dict)
    )

    def __post_init__(self) -> None:
        self.family()

    def family(self) -> TubeFamily:
        return TubeFamily(self.lines, self.friction_profile, self.readings, self.provenance)


def _rounded(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_rounded(each) for each in value]
    return float(f'{value:.{_DIGITS}g}')

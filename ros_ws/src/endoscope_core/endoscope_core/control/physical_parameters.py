"""Parameters of the plant that the physical inverse inverts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any

from endoscope_core.plant import JointParameters


@dataclass(frozen=True)
class PhysicalParameters:
    """One joint behind one tube.

    Parameters
    ----------
    joint : JointParameters
        Of the nominal plant; the capstan exponent is the tube's.
    evenness : float
        Share of the friction that is spread along the sheath, in [0, 1]; the rest is at its ends.

    Raises
    ------
    ValueError
        If the evenness is out of range.
    """

    joint: JointParameters = field(default_factory=JointParameters)
    evenness: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.evenness) and 0.0 <= self.evenness <= 1.0):
            raise ValueError(f'evenness = {self.evenness} must lie in [0, 1]')

    def to_dict(self) -> dict[str, float]:
        """All numbers by name."""
        return {**asdict(self.joint), 'evenness': self.evenness}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> PhysicalParameters:
        """Parameters from a mapping of exactly their names.

        Raises
        ------
        ValueError
            If a name is missing or unknown, or a value is out of range.
        """
        names = {item.name for item in fields(JointParameters)}
        if set(values) != names | {'evenness'}:
            odd = ', '.join(sorted(set(values) ^ (names | {'evenness'})))
            raise ValueError(f'parameters of the plant are wrong or missing: {odd}')
        numbers = {name: float(value) for name, value in values.items()}
        evenness = numbers.pop('evenness')
        return cls(JointParameters(**numbers), evenness)

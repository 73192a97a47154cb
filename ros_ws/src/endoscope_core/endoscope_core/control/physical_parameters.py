"""Parameters of the plant that the physical inverse inverts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from endoscope_core.physics.description import JointParameters

PROFILE = 'friction_profile'


@dataclass(frozen=True)
class PhysicalParameters:
    """One joint behind one tube.

    Parameters
    ----------
    joint : JointParameters
        Of the nominal plant; the capstan exponent is the tube's.
    """

    joint: JointParameters = field(default_factory=JointParameters)

    def to_dict(self) -> dict[str, Any]:
        """All numbers by name; the friction profile is a list."""
        values = {item.name: getattr(self.joint, item.name) for item in fields(JointParameters)}
        return values | {PROFILE: list(self.joint.friction_profile)}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> PhysicalParameters:
        """Parameters from a mapping of exactly their names.

        Raises
        ------
        ValueError
            If a name is missing or unknown, or a value is out of range.
        """
        names = {item.name for item in fields(JointParameters)}
        if set(values) != names:
            odd = ', '.join(sorted(set(values) ^ names))
            raise ValueError(f'parameters of the plant are wrong or missing: {odd}')
        numbers = {name: float(values[name]) for name in names - {PROFILE}}
        profile = tuple(float(value) for value in values[PROFILE])
        return cls(JointParameters(**numbers, friction_profile=profile))

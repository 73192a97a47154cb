"""How far a tube lets the tip be bent."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from endoscope_core.control.internal_model import InternalModel
from endoscope_core.control.motor_limits import MotorLimits, shipped_limits
from endoscope_core.physics.description import JointParameters

_BEYOND = 10.0
"""Rad to which no joint bends."""


@dataclass(frozen=True)
class Reach:
    """Smallest and largest bending angle, rad."""

    low: float
    high: float

    def keep(self, angle: float, velocity: float) -> tuple[float, float]:
        """A desired angle within reach, and its velocity: zero where the angle is cut."""
        within = min(self.high, max(self.low, angle))
        return within, velocity if within == angle else 0.0


def reach_in_words(reaches: Sequence[Reach], joints: Sequence[str]) -> str:
    """How far the joints of these names can be bent, in degrees, as a sentence without its stop."""
    ranges = ', '.join(
        f'{joint} from {math.degrees(r.low):.0f} to {math.degrees(r.high):.0f} deg'
        for joint, r in zip(joints, reaches, strict=True)
    )
    return f'this tube can be bent: {ranges}'


def keep_within(
    reaches: Sequence[Reach], angle: Sequence[float], velocity: Sequence[float]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Desired angles (rad) and velocities (rad/s) of J joints, cut where a tube's reach ends.

    Nothing is cut where no reach is known; where no velocities are given, none are returned.
    """
    if not reaches:
        return tuple(angle), tuple(velocity)
    speeds = velocity or (0.0,) * len(angle)
    kept = [r.keep(a, v) for r, a, v in zip(reaches, angle, speeds, strict=True)]
    return tuple(a for a, _ in kept), tuple(v for _, v in kept) if velocity else ()


def reach(joint: JointParameters, limits: MotorLimits | None = None) -> Reach:
    """Find how far a joint can be bent to and fro, time and again.

    The motor swings slowly as far as its travel and the wires' tension allow. A first pull from
    rest gets elsewhere than later ones, which begin in wires that friction has left tense.

    Parameters
    ----------
    joint : JointParameters
        With the friction of the tube at hand.
    limits : MotorLimits, optional
        Those of the shipped rig if not given.

    Returns
    -------
    Reach
    """
    model = InternalModel(joint, limits or shipped_limits())
    there_and_back = [_BEYOND, -_BEYOND] * 2
    model.go_through(there_and_back)
    low = model.angle
    model.go_through([*there_and_back, _BEYOND])
    return Reach(low, model.angle)

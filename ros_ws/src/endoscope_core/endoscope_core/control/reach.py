"""How far a tube lets the tip be bent."""

from __future__ import annotations

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

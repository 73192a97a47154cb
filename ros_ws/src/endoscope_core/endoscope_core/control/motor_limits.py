"""What the motor of a joint may do, and how its shaft turns against the joint."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

from endoscope_core.rig import Rig, shipped_rig


@dataclass(frozen=True)
class MotorLimits:
    """Bounds that a compensator keeps to.

    Parameters
    ----------
    gear : float
        Shaft angle for one radian of desired bending.
    travel : float
        Largest shaft angle either way, rad.
    speed : float
        Largest speed of the shaft, rad/s.
    tension : float
        Largest tension of a wire at the motor, N.

    Raises
    ------
    ValueError
        If one is not positive and finite.
    """

    gear: float
    travel: float
    speed: float
    tension: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f'{name} = {value} must be positive and finite')

    @classmethod
    def of(cls, rig: Rig) -> MotorLimits:
        """Those of a rig; a wire may be pulled as far as a calibration pulls it."""
        return cls(
            gear=rig.joints.gear,
            travel=rig.joints.drive * rig.joints.gear,
            speed=rig.motors.speed,
            tension=rig.tension.calibration_ceiling,
        )


@cache
def shipped_limits() -> MotorLimits:
    """Those of the rig that is shipped."""
    return MotorLimits.of(shipped_rig())

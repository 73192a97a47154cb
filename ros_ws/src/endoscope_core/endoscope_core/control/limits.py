"""Bounds that a compensator keeps to, and steps that keep to them smoothly."""

from __future__ import annotations

import math
from dataclasses import dataclass

from endoscope_core.rig import Rig

COUNT = 2.0 * math.pi / 4096.0
"""Angle in rad between two neighbouring counts of a 12-bit encoder, as handles have it."""

SHARE_OF_TRAVEL = 0.5
"""What a law may add of its own accord to each radian that the desired angle moves.

Below 1, so that nothing that fades in or out, is worked off or was learnt turns the motion round
that was asked for, and nothing moves while nothing is asked for.
"""


@dataclass(frozen=True)
class MotorLimits:
    """Bounds in rad, rad/s and N that a compensator keeps to.

    ValueError if one is not positive and finite.
    """

    gear: float  # shaft angle for one radian of desired bending
    travel: float  # largest shaft angle either way, rad
    speed: float  # largest speed of the shaft, rad/s
    tension: float  # largest tension of a wire at the motor, N

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


class Play:
    """Follows a value, from `value` on, as soon as it leaves a band around the last one.

    Noise within the band stays without any effect, and a motion one way comes out as a motion one
    way. What comes out is never further from the value than half the band (Visintin, Differential
    Models of Hysteresis, 1994, section III.2).
    """

    def __init__(self, half_width: float, value: float) -> None:
        self._half_width = half_width
        self.value = value

    def follow(self, value: float) -> float:
        """What comes out for a new value."""
        half = self._half_width
        if value - half > self.value:
            self.value = value - half
        elif value + half < self.value:
            self.value = value + half
        return self.value


class SmoothFollower:
    """Critically damped second-order low-pass, position and velocity at once, at rest at first.

    ``p'' = w**2 (u - p) - 2 w p'``, solved exactly for an input `u` that is held for a period of
    any length. A steady motion is followed ``2 / w`` late. The impulse response, ``w**2 t`` times
    ``exp(-w t)``, is nowhere negative: a motion one way comes out as a motion one way, and a step
    is approached without overshoot. `w` is the `bandwidth` in rad/s; half the power is left at
    ``0.64 w``.
    """

    def __init__(self, bandwidth: float, position: float) -> None:
        self._bandwidth = bandwidth
        self.position = position
        self.velocity = 0.0

    def follow(self, value: float, dt: float) -> None:
        """Go on for `dt` s towards a value."""
        w = self._bandwidth
        away = self.position - value
        slope = self.velocity + w * away
        decay = math.exp(-w * dt)
        self.position = value + (away + slope * dt) * decay
        self.velocity = (self.velocity - w * slope * dt) * decay


def limited(value: float, bound: float) -> float:
    """The value, held within a bound either way."""
    return bound if value > bound else -bound if value < -bound else value


def worked_off(value: float, travel: float, bound: float) -> float:
    """What a step leaves of a value in rad that is taken off bit by bit, until nothing is left.

    At most `bound` rad, and at most `SHARE_OF_TRAVEL` of the `travel` in rad that the desired angle
    has moved either way, are taken off.
    """
    most = min(bound, SHARE_OF_TRAVEL * travel)
    return value - limited(value, most)

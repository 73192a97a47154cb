"""What turns one joint's desired angle into a motor angle, in one form for every mode."""

from __future__ import annotations

from typing import Protocol

from endoscope_core.control.smoothing import Play
from endoscope_core.hysteresis.dahl_kernel import dahl_step
from endoscope_core.hysteresis.inverse import HysteresisParameters, inverse_of


class JointInverse(Protocol):
    """Feed-forward of one joint."""

    @property
    def direction(self) -> float:
        """Which way the motion has taken, in [-1, 1]; handed on when the mode changes."""
        ...

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start at a desired angle and velocity (rad, rad/s); return the command wanted (rad)."""
        ...

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        """Command (rad) for the desired angle and velocity, `dt` s after the last."""
        ...

    def sent(self, command: float, dt: float) -> None:
        """Learn what went out in the end (rad), in force for `dt` s."""
        ...


class Passing:
    """No compensation: the desired angle passes, its direction is remembered over `travel` rad."""

    def __init__(self, travel: float) -> None:
        self._travel = travel
        self._desired = 0.0
        self._direction = 0.0

    @property
    def direction(self) -> float:
        """Which way the desired motion has taken."""
        return self._direction

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start; the desired angle is wanted."""
        self._direction, self._desired = direction, desired
        return desired

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        """The desired angle."""
        moved = desired - self._desired
        self._direction = float(dahl_step(self._direction, moved, self._travel, 1.0))
        self._desired = desired
        return desired

    def sent(self, command: float, dt: float) -> None:
        """Nothing depends on it."""


class HysteresisInverse:
    """Inverse of a hysteresis model, driven by the desired angle as it will be `lead` s later.

    The foreseen angle may turn back by `dead_band` rad without any effect, half of it either way:
    the lead makes a motion the other way of every slowing down, and the inverse amplifies it.
    """

    def __init__(self, parameters: HysteresisParameters, lead: float, dead_band: float) -> None:
        self._parameters = parameters
        self._lead = lead
        self._foreseen = Play(0.5 * dead_band, 0.0)
        self._inverse = inverse_of(parameters, 0.0, 0.0)

    @property
    def direction(self) -> float:
        """Which way the desired motion has taken."""
        return self._inverse.direction

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start with the memory that `direction` says."""
        self._foreseen.value = desired + self._lead * velocity
        self._inverse = inverse_of(self._parameters, direction, self._foreseen.value)
        return self._inverse.command()

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        """Command of the inverse."""
        self._inverse.move_to(self._foreseen.follow(desired + self._lead * velocity))
        return self._inverse.command()

    def sent(self, command: float, dt: float) -> None:
        """Nothing depends on it."""

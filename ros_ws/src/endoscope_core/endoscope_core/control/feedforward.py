"""Feed-forward compensation of all joints, whose mode can be changed while it runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from endoscope_core.choices import ADAPTIVE_PHYSICAL, MODES, PHYSICAL
from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.control.limits import COUNT, MotorLimits, Play, limited, worked_off
from endoscope_core.control.physical_inverse import AdaptivePhysicalInverse, PhysicalInverse
from endoscope_core.hysteresis import MODELS, HysteresisParameters
from endoscope_core.hysteresis.dahl import dahl_step
from endoscope_core.hysteresis.memory_model import DirectInverse

Vector = Sequence[float] | NDArray[np.float64]
LawParameters = HysteresisParameters | PhysicalParameters
"""Parameters of a joint, of any mode."""


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
        self.direction = 0.0

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        self.direction, self._desired = direction, desired
        return desired

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        moved = desired - self._desired
        self.direction = float(dahl_step(self.direction, moved, self._travel, 1.0))
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
        self._inverse = DirectInverse(parameters, 0.0, 0.0)

    @property
    def direction(self) -> float:
        return self._inverse.direction

    def begin(self, direction: float, desired: float, velocity: float) -> float:
        """Start with the memory that `direction` says."""
        self._foreseen.value = desired + self._lead * velocity
        self._inverse = DirectInverse(self._parameters, direction, self._foreseen.value)
        return self._inverse.command()

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        self._inverse.move_to(self._foreseen.follow(desired + self._lead * velocity))
        return self._inverse.command()

    def sent(self, command: float, dt: float) -> None:
        """Nothing depends on it."""


@dataclass(frozen=True)
class FeedforwardLaw:
    """What the compensator does with a desired angle.

    ValueError if the mode is unknown, or lacks parameters of its kind: no motion is guessed.
    """

    # One of `MODES`. 'none' passes the desired angle through, the names of hysteresis models
    # invert them, 'physical' inverts the plant and 'adaptive_physical' also learns the plant from
    # the tracker.
    mode: str = 'none'
    # One for each joint, of the mode's kind; may be empty in mode 'none'.
    parameters: tuple[LawParameters, ...] = ()

    def __post_init__(self) -> None:
        if self.mode not in MODES:
            raise ValueError(
                f'unknown compensation mode {self.mode!r}: choose one of {", ".join(MODES)}'
            )
        if self.mode == 'none':
            return
        if not self.parameters:
            raise ValueError(f'mode {self.mode!r} needs parameters for each joint: calibrate first')
        physical = self.mode in (PHYSICAL, ADAPTIVE_PHYSICAL)
        kind = PhysicalParameters if physical else MODELS[self.mode]
        for given in self.parameters:
            if not isinstance(given, kind):
                raise ValueError(
                    f'mode {self.mode!r} needs {kind.__name__}, not {type(given).__name__}'
                )
            adaptive = self.mode == ADAPTIVE_PHYSICAL
            if adaptive and isinstance(given, PhysicalParameters) and given.added:
                raise ValueError(f'mode {self.mode!r} learns a nominal plant, not one with effects')


@dataclass(frozen=True)
class FeedforwardSettings:
    """How the feed-forward moves in time; angles in rad, times in s."""

    limits: MotorLimits  # that the physical modes keep to
    # s by which the desired angle is foreseen, ``theta_d + lead theta_d'``: the servo's own lag,
    # so that the motor has crossed the dead zone when the joint is to turn back. 0 gives equation
    # 5 as printed. The physical modes know their servo and take no notice.
    lead: float = 0.06
    # Greatest speed of the command in rad/s. A reversal at high acceleration asks for more; the
    # motor could not follow it and a gate before the motor would refuse it.
    speed_limit: float = 20.0
    # Greatest speed in rad/s at which the jump left by a switch is worked off; never by more than
    # half of what the desired angle moves, so that nothing moves while it rests.
    offset_rate: float = 0.5
    offset_time: float = 0.3  # time constant in s of the last part of that
    # rad over which the memory of the direction builds up in mode 'none'.
    resting_travel: float = math.radians(1.0)
    # rad by which the foreseen angle may turn back without any effect: two counts of an encoder.
    dead_band: float = 2.0 * COUNT

    def __post_init__(self) -> None:
        if not (0.0 <= self.lead <= 0.5):
            raise ValueError(f'lead = {self.lead} s must lie in [0, 0.5]')
        for name in ('speed_limit', 'offset_rate', 'offset_time', 'resting_travel'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f'{name} = {value} must be positive and finite')
        if not (math.isfinite(self.dead_band) and self.dead_band >= 0.0):
            raise ValueError(f'dead_band = {self.dead_band} must be finite and not negative')


@dataclass
class _Joint:
    """One joint on its way; angles in rad."""

    inverse: JointInverse
    desired: float
    velocity: float
    wanted: float
    command: float
    offset: float = 0.0
    rested: bool = True


class Feedforward:
    """Feed-forward of all joints; its law can be changed while it runs without a jump.

    The difference between what the old law put out and what the new one wants becomes an offset
    that is worked off while the desired angle moves. The command's speed is at most `speed_limit`
    in every mode.
    """

    def __init__(self, joints: int, settings: FeedforwardSettings) -> None:
        self.settings = settings
        self.law = FeedforwardLaw()
        self._count = joints
        self._joints: list[_Joint] = []
        self._start: list[float] | None = None
        self._compiled: set[str] = set()

    @property
    def command(self) -> NDArray[np.float64] | None:
        """Last command (J,) in rad, None before the first step."""
        return np.array([joint.command for joint in self._joints]) if self._joints else None

    @property
    def offset(self) -> NDArray[np.float64]:
        """What is left of the last switch, (J,) in rad; zero before the first step."""
        return np.array([joint.offset for joint in self._joints] or [0.0] * self._count)

    @property
    def learnt(self) -> tuple[PhysicalParameters, ...]:
        """Parameters as learnt so far, for each joint that learns."""
        return tuple(
            joint.inverse.parameters
            for joint in self._joints
            if isinstance(joint.inverse, AdaptivePhysicalInverse)
        )

    def select(self, law: FeedforwardLaw) -> None:
        """Put another law in force from the next step on; the command goes on from where it is.

        ValueError if the law has parameters for another number of joints; the law in force stays.
        """
        if law.parameters and len(law.parameters) != self._count:
            raise ValueError(
                f'parameters for {len(law.parameters)} joints given, {self._count} wanted'
            )
        self.law = law
        desired = [joint.desired for joint in self._joints]
        for j, joint in enumerate(self._joints):
            before = joint.inverse.direction
            joint.inverse = self._inverse(j, desired)
            joint.wanted = joint.inverse.begin(before, joint.desired, joint.velocity)
            joint.offset = joint.command - joint.wanted

    def compile(self, law: FeedforwardLaw) -> None:
        """Compile the mode of a law before a command waits for it, once."""
        if law.mode in self._compiled:
            return
        trial, zero = Feedforward(self._count, self.settings), [0.0] * self._count
        trial.select(law)
        trial.step(zero, zero, 1e-3)
        trial.measure(0.0, zero)
        self._compiled.add(law.mode)

    def rebase(self, command: Vector, desired: Vector | None = None) -> None:
        """Go on from this command (J,) in rad, sent by someone else meanwhile, without a jump.

        `desired` (J,) in rad is where a new stream begins, at rest; by default the stream goes on.
        ValueError if an angle has another size or is not finite.
        """
        start = self._checked('command', command)
        if desired is not None:
            begin = self._checked('desired', desired)
            for joint, angle in zip(self._joints, begin, strict=False):
                joint.desired, joint.velocity = angle, 0.0
            self._couple(begin)
        if not self._joints:
            self._start = start
            return
        for joint, angle in zip(self._joints, start, strict=True):
            joint.command = angle
            joint.wanted = joint.inverse.begin(
                joint.inverse.direction, joint.desired, joint.velocity
            )
            joint.offset = angle - joint.wanted

    def step(self, desired: Vector, velocity: Vector, dt: float) -> NDArray[np.float64]:
        """Joint-equivalent command (J,) in rad for a desired angle and velocity, rad and rad/s.

        `dt` is the time in s since the last step. ValueError if an input has another size or is not
        finite, or `dt` is not positive; nothing changes then.
        """
        angles = self._checked('desired', desired)
        speeds = self._checked('velocity', velocity)
        if not (math.isfinite(dt) and dt > 0.0):
            raise ValueError(f'dt = {dt} s must be positive and finite')
        self._couple(angles)
        if not self._joints:
            self._begin(angles, speeds)
        return np.array(
            [
                self._step(joint, angle, speed, dt)
                for joint, angle, speed in zip(self._joints, angles, speeds, strict=True)
            ]
        )

    def measure(self, age: float, angle: Vector) -> None:
        """Let the modes that learn have bending angles (J,) in rad that held `age` s ago.

        A joint that has rested since the last ones learns nothing, and what another learns enters
        its command as it moves: the difference becomes an offset, as after a switch.

        ValueError if the angles have another size or are not finite.
        """
        angles = self._checked('angle', angle)
        for joint, measured in zip(self._joints, angles, strict=False):
            if isinstance(joint.inverse, AdaptivePhysicalInverse) and not joint.rested:
                before = joint.inverse.command
                joint.inverse.measured(age, measured)
                joint.offset += before - joint.inverse.command
            joint.rested = True

    def _step(self, joint: _Joint, desired: float, velocity: float, dt: float) -> float:
        c = self.settings
        travel = abs(desired - joint.desired)
        joint.rested = joint.rested and travel == 0.0
        joint.wanted = joint.inverse.wanted(desired, velocity, dt)
        joint.desired, joint.velocity = desired, velocity
        most = min(c.offset_rate * dt, abs(joint.offset) * min(1.0, dt / c.offset_time))
        joint.offset = worked_off(joint.offset, travel, most)
        joint.command += limited(joint.wanted + joint.offset - joint.command, c.speed_limit * dt)
        joint.inverse.sent(joint.command, dt)
        return joint.command

    def _couple(self, angles: Sequence[float]) -> None:
        """Tell the inverse of each joint where the other one is to be, in rad."""
        for j, joint in enumerate(self._joints):
            if isinstance(joint.inverse, PhysicalInverse):
                joint.inverse.other = _other_than(j, angles)

    def _begin(self, angles: list[float], speeds: list[float]) -> None:
        start = self._start
        for j, (angle, speed) in enumerate(zip(angles, speeds, strict=True)):
            inverse = self._inverse(j, angles)
            wanted = inverse.begin(0.0, angle, speed)
            command = wanted if start is None else start[j]
            self._joints.append(_Joint(inverse, angle, speed, wanted, command, command - wanted))

    def _inverse(self, number: int, angles: Sequence[float]) -> JointInverse:
        """The inverse of a joint where the joints are to be at these angles (J,) in rad."""
        if self.law.mode == 'none':
            return Passing(self.settings.resting_travel)
        parameters = self.law.parameters[number]
        if not isinstance(parameters, PhysicalParameters):
            return HysteresisInverse(parameters, self.settings.lead, self.settings.dead_band)
        kind = PhysicalInverse if self.law.mode == PHYSICAL else AdaptivePhysicalInverse
        inverse = kind(parameters, self.settings.limits, self.settings.dead_band)
        inverse.other = _other_than(number, angles)
        return inverse

    def _checked(self, name: str, values: Vector) -> list[float]:
        numbers = list(map(float, values))
        if len(numbers) != self._count or not all(map(math.isfinite, numbers)):
            raise ValueError(f'{name} must be {self._count} finite numbers, not {numbers}')
        return numbers


def _other_than(joint: int, angles: Sequence[float]) -> float:
    """Angle in rad of the other one of two joints; zero where there are not two."""
    return angles[1 - joint] if len(angles) == 2 else 0.0

"""One joint behind one tube as a compensator keeps it in mind, and how far it can be bent.

The model is the plant itself with the shaft given: the nominal one or, where a plant file has been
adopted, one with effects. Friction along the sheath, the joint's friction and its stiffness do not
depend on speed, so a motion is known by its turning points: with other parameters the model is
brought to where it would be by going through them again (return-point memory: Mayergoyz,
Mathematical Models of Hysteresis, 1991, ch. I).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled import Flags, compiled
from endoscope_core.control.limits import MotorLimits
from endoscope_core.physics.description import (
    EffectSpec,
    JointParameters,
    PlantDescription,
    TermSpec,
)
from endoscope_core.physics.effect import Effect, Stage
from endoscope_core.physics.effects import describe
from endoscope_core.physics.functions import describe_place
from endoscope_core.physics.kernel import advance_tick, exponent_varies, settle, tensions
from endoscope_core.physics.layout import (
    IN_MOTOR,
    IN_OTHER_JOINT,
    INPUTS,
    MOTOR,
    TIP,
)
from endoscope_core.physics.packing import pack, rest_state
from endoscope_core.physics.sheath import MOTOR_END
from endoscope_core.physics.simulator import simulate
from endoscope_core.safety import BendingRange

PROFILE = 'friction_profile'
Array = NDArray[np.float64]
Added = tuple[EffectSpec | TermSpec, ...]
"""Physics of one joint beyond the nominal plant, whatever joint its entries name."""

TICK = 1e-3
PRECISION = 1e-7
"""Rad by which the model's joint may miss an angle that it can reach."""
_LONGEST_TICK = 1.0
_SHAFT_STEP = 0.1
_JOINT_STEP = 0.1
"""Rad: with such steps a motion is gone through again, within 0.01 deg of where small ones lead."""
_TRIES = 60
_STEPS = 1000
_MOST_TURNS = 12
_RAMPS, _RAMP_S = (0.1, 0.2), 5.0
"""Speeds of a shaft in rad/s, and how long it turns, which show the lag of a servo with effects."""
_ALONE = 'joint'
_BEYOND = 10.0
"""Rad to which no joint bends."""


@dataclass(frozen=True)
class PhysicalParameters:
    """One joint behind one tube."""

    # Of the nominal plant; the capstan exponent is the tube's.
    joint: JointParameters = field(default_factory=JointParameters)
    added: Added = ()  # of an adopted plant

    @cached_property
    def servo_lag(self) -> float:
        """Time in s by which the servo follows a steady motion late."""
        # Kept: it takes 10 ms where the servo has effects, and a law is put in force between ticks.
        if not any(definition_of(entry).stage is Stage.ACTUATOR for entry in self.added):
            return 2.0 * self.joint.motor_damping_ratio / self.joint.motor_bandwidth
        # What stays away by the same angle at any speed is no lag.
        behind = [self._behind_ramp(speed) for speed in _RAMPS]
        return max(0.0, (behind[1] - behind[0]) / (_RAMPS[1] - _RAMPS[0]))

    def _behind_ramp(self, speed: float) -> float:
        """By what angle in rad a shaft is behind a command of this speed in the end, rad/s."""
        command = speed * TICK * np.arange(round(_RAMP_S / TICK))
        run = simulate(plant_of_joint(self.joint, self.added), command[:, None], TICK)
        return float(command[-1] - run.shaft_position[-1, 0])

    def to_dict(self) -> dict[str, Any]:
        """All nominal numbers by name; the friction profile is a list."""
        values = {item.name: getattr(self.joint, item.name) for item in fields(JointParameters)}
        return values | {PROFILE: list(self.joint.friction_profile)}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> PhysicalParameters:
        """Parameters from a mapping of exactly their names; a ValueError names what is wrong."""
        if odd := {item.name for item in fields(JointParameters)} ^ set(values):
            raise ValueError(
                f'parameters of the plant are wrong or missing: {", ".join(sorted(odd))}'
            )
        numbers = {name: float(value) for name, value in values.items() if name != PROFILE}
        profile = tuple(float(value) for value in values[PROFILE])
        return cls(JointParameters(**numbers, friction_profile=profile))


class TurningPoints:
    """Where a motion turned round, as far as hysteresis without speed remembers it.

    `values` are its begin, turning points and present value. A loop within a larger one is
    forgotten once it is closed: the pair of turning points between two larger swings, as in the
    counting of rainflow cycles (ASTM E1049). Of more than twelve, the smallest swing goes.
    """

    def __init__(self, values: Sequence[float]) -> None:
        self.values = list(values)

    def follow(self, value: float) -> None:
        """Go on to a value."""
        v = self.values
        if len(v) > 1 and (v[-1] - v[-2]) * (value - v[-1]) >= 0.0:
            v[-1] = value
        elif value != v[-1]:
            v.append(value)
        while len(v) > 3 and abs(v[-2] - v[-3]) <= min(abs(v[-1] - v[-2]), abs(v[-3] - v[-4])):
            del v[-3:-1]
        if len(v) > _MOST_TURNS:
            swings = [abs(b - a) for a, b in pairwise(v[1:-1])]
            least = 1 + swings.index(min(swings))
            del v[least : least + 2]


Model = tuple[Array, Array, Array, Array, Flags, Array]
"""A plant as the kernel takes it: state, history, sheath, parameters, flags, inputs.

N plants that turn together have (N, ...) each, and the same inputs. A plain tuple: numba takes a
microsecond longer to recognise a named one, a third of what `seek` takes.
"""


@compiled
def _try(model: Model, trial: Array, tried: Array, shaft: float, tick: float) -> float:
    """Tip's angle in rad after a tick in which the shaft turns to `shaft`, left in `trial`."""
    x, history, sheath, p, on, inputs = model
    for i in range(len(x)):
        trial[i] = x[i]
    inputs[IN_MOTOR] = shaft
    if exponent_varies(on):
        # The tick works out shapes of its own, which the next trial must not begin with.
        _copy(sheath, tried)
        advance_tick(trial, history, tried, p, on, inputs, tick)
    else:
        advance_tick(trial, history, sheath, p, on, inputs, tick)
    return trial[TIP]


@compiled
def _copy(source: Array, target: Array) -> None:
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def _seek(
    model: Model,
    trial: Array,
    tried: Array,
    target: float,
    low: float,
    high: float,
    tension_limit: float,
    tick: float,
) -> None:
    """Turn the shaft within [low, high] so that the tip is at `target` after a tick.

    The tip's angle grows with the shaft's and stands still in the dead zone: a bracketed secant
    (Dowell, Jarratt, BIT 11, 1971) finds the shaft's angle. What cannot be reached is approached as
    far as bounds and tension allow.
    """
    x, sheath, on = model[0], model[2], model[4]
    near = x[MOTOR]
    near_error = _try(model, trial, tried, near, tick) - target
    if abs(near_error) > PRECISION:
        way = -1.0 if near_error > 0.0 else 1.0
        far = high if way > 0.0 else low
        error = _try(model, trial, tried, far, tick) - target
        shaft, far_error = far, error
        if way * error > 0.0:
            for _ in range(_TRIES):
                if abs(error) <= PRECISION or abs(far - near) <= 1e-12:
                    break
                shaft = far - far_error * (far - near) / (far_error - near_error)
                error = _try(model, trial, tried, shaft, tick) - target
                if error * far_error > 0.0:
                    near_error *= 1.0 - error / far_error if error / far_error < 0.9 else 0.5
                else:
                    near, near_error = far, far_error
                far, far_error = shaft, error
        side = 0 if way > 0.0 else 1
        used = tried if exponent_varies(on) else sheath
        if tensions(trial, used, MOTOR_END)[side] > tension_limit:
            allowed, too_far = x[MOTOR], shaft
            for _ in range(_TRIES):
                if abs(too_far - allowed) <= 1e-9:
                    break
                shaft = 0.5 * (allowed + too_far)
                _try(model, trial, tried, shaft, tick)
                if tensions(trial, used, MOTOR_END)[side] > tension_limit:
                    too_far = shaft
                else:
                    allowed = shaft
            _try(model, trial, tried, allowed, tick)
    for i in range(len(x)):
        x[i] = trial[i]
    if exponent_varies(on):
        _copy(tried, sheath)


@compiled
def _go_through_angles(
    model: Model,
    trial: Array,
    tried: Array,
    path: Array,
    travel: float,
    tension_limit: float,
) -> None:
    """From rest, bend the tip slowly to the angles of `path`, which become those of the shaft."""
    x, history, sheath, p, on, _ = model
    settle(x, history, sheath, p, on, 0.0, TICK)
    for i in range(len(path)):
        target = path[i]
        way = 1.0 if target > x[TIP] else -1.0
        for _ in range(_STEPS):
            left = target - x[TIP]
            # A hair beyond, where damping let go: to come back would cross the dead zone.
            if way * left <= 2.0 * PRECISION:
                break
            before = x[MOTOR]
            low = max(-travel, before - _SHAFT_STEP)
            high = min(travel, before + _SHAFT_STEP)
            angle = x[TIP] + min(_JOINT_STEP, max(-_JOINT_STEP, left))
            low, high = min(low, before), max(high, before)
            _seek(model, trial, tried, angle, low, high, tension_limit, _LONGEST_TICK)
            if abs(x[MOTOR] - before) <= 1e-9:
                break
        path[i] = x[MOTOR]


@compiled
def turn_all(models: Model, shaft: float, tick: float) -> None:
    """Turn the shafts of several models to one angle (rad) within a tick (s)."""
    x, history, sheath, p, on, inputs = models
    inputs[IN_MOTOR] = shaft
    for i in range(len(x)):
        advance_tick(x[i], history[i], sheath[i], p[i], on[i], inputs, tick)


@compiled
def go_through_shafts(models: Model, path: Array) -> None:
    """From rest, turn the shafts of several models to one angle after the other, slowly."""
    x, history, sheath, p, on, inputs = models
    for i in range(len(x)):
        settle(x[i], history[i], sheath[i], p[i], on[i], 0.0, TICK)
        for target in path:
            begin = x[i, MOTOR]
            steps = int(abs(target - begin) / _SHAFT_STEP) + 1
            for k in range(1, steps + 1):
                inputs[IN_MOTOR] = begin + (target - begin) * k / steps
                advance_tick(x[i], history[i], sheath[i], p[i], on[i], inputs, _LONGEST_TICK)


def definition_of(entry: EffectSpec | TermSpec) -> Effect:
    """What is known of added physics by its effect, or by the place of its function."""
    return describe(entry.id) if isinstance(entry, EffectSpec) else describe_place(entry.place)


def added_to(plant: PlantDescription) -> Added:
    """All physics of a plant beyond the nominal one."""
    return (*plant.effects, *plant.terms)


def plant_of_joint(joint: JointParameters, added: Added = ()) -> PlantDescription:
    """A plant of this joint alone, with physics beyond the nominal plant."""
    here = [replace(entry, joint=_ALONE) for entry in added]
    return PlantDescription(
        joints={_ALONE: joint},
        effects=tuple(entry for entry in here if isinstance(entry, EffectSpec)),
        terms=tuple(entry for entry in here if isinstance(entry, TermSpec)),
    )


def packed_joint(joint: JointParameters, added: Added = ()) -> tuple[Array, Flags]:
    """Parameters (P,) and flags of one joint, as the compiled plant takes them."""
    parameters, on = pack(plant_of_joint(joint, added))
    return parameters[0], on[0]


class InternalModel:
    """The plant of one joint, at rest at first; angles of motor are the shaft's."""

    def __init__(self, joint: JointParameters, limits: MotorLimits, added: Added = ()) -> None:
        self._limits = limits
        p, on = packed_joint(joint, added)
        states, histories, sheaths = rest_state(p[None], on[None], TICK)
        self._state, self._sheath = states[0], sheaths[0]
        self._trial, self._tried = np.empty_like(self._state), np.empty_like(self._sheath)
        self._inputs = np.zeros(INPUTS)
        self._model = (self._state, histories[0], self._sheath, p, on, self._inputs)

    @property
    def angle(self) -> float:
        """Tip's angle, rad."""
        return float(self._state[TIP])

    @property
    def other(self) -> float:
        """Angle in rad of the other joint, which may be coupled."""
        return float(self._inputs[IN_OTHER_JOINT])

    @other.setter
    def other(self, angle: float) -> None:
        self._inputs[IN_OTHER_JOINT] = angle

    @property
    def shaft(self) -> float:
        """Shaft angle, rad."""
        return float(self._state[MOTOR])

    @property
    def tensions(self) -> tuple[float, float]:
        """Tensions of both wires at the motor, N."""
        a, b = tensions(self._state, self._sheath, MOTOR_END)
        return float(a), float(b)

    def turn(self, shaft: float, dt: float) -> None:
        """Turn the shaft to an angle (rad) within `dt` s."""
        self._inputs[IN_MOTOR] = shaft
        advance_tick(*self._model, dt)

    def seek(self, angle: float, dt: float) -> bool:
        """Turn the shaft for `dt` s within its limits; whether the joint is then at `angle` rad."""
        m, shaft = self._limits, self.shaft
        # A shaft that is beyond its travel may stay there, and come back.
        low = min(shaft, max(-m.travel, shaft - m.speed * dt))
        high = max(shaft, min(m.travel, shaft + m.speed * dt))
        _seek(self._model, self._trial, self._tried, angle, low, high, m.tension, dt)
        return abs(self.angle - angle) <= 2.0 * PRECISION

    def go_through(self, angles: Sequence[float]) -> list[float]:
        """Bend slowly from rest to one angle (rad) after the other; the shaft's angle at each."""
        path = np.array(angles, dtype=float)
        m = self._limits
        _go_through_angles(self._model, self._trial, self._tried, path, m.travel, m.tension)
        return path.tolist()


def bending_range(joint: JointParameters, limits: MotorLimits, added: Added = ()) -> BendingRange:
    """Find how far a joint can be bent to and fro, in rad, time and again.

    The motor swings slowly as far as its travel and the wires' tension allow.
    """
    model = InternalModel(joint, limits, added)
    there_and_back = [_BEYOND, -_BEYOND] * 2
    # A first pull from rest gets elsewhere than later ones, which begin in wires left tense.
    model.go_through(there_and_back)
    low = model.angle
    model.go_through([*there_and_back, _BEYOND])
    return BendingRange(low, model.angle)

"""Changes of a rig that are detected in operation, and tolerances of a healthy rig.

Each direction is one number of a joint: the plant with that number changed predicts other readings,
and the difference is the signature of the change. Directions that are not reported as a change,
such as the stiffness of the wires, are only estimated, so that a slightly wrong description is not
taken for a change.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Any

from endoscope_core.physics.description import (
    NUMBERS,
    EffectSpec,
    JointParameters,
    PlantDescription,
)

HEALTHY = 0.1 / math.sqrt(3.0)
"""Rms of the relative difference of a scaled number from its description: within 10 %."""
SMALLEST = 1.0 / 3.0
"""Share of a change's typical size below which it is not reported, however certain it is."""
DRIFT_S = 100.0
"""Seconds of motion in which a number drifts by its `drift`."""


class Part(StrEnum):
    """Part of the rig in which a change is located."""

    CELL = 'cell'
    TRACKER = 'tracker'
    WIRE = 'wire'
    SHEATH = 'sheath'
    JOINT = 'joint'
    ACTUATOR = 'actuator'


@dataclass(frozen=True)
class Direction:
    """One number of a joint, counted in steps."""

    name: str  # of the number
    step: float  # what one step is: SI, or a share of the number where `scaled`
    tolerance: float = 0.0  # rms by which a healthy rig's is off from the described one, in steps
    drift: float = 0.0  # rms by which it changes in `DRIFT_S` of motion of a healthy rig, in steps
    number: str = ''  # key of the joint's parameters that it is added to, or empty
    scaled: bool = False  # whether the step is a share of that number
    # Effect of the catalogue and its parameter, or empty, and its other parameters.
    effect: str = ''
    parameter: str = ''
    at: Mapping[str, float] = field(default_factory=dict)

    def changed(self, plant: PlantDescription, joint: str) -> PlantDescription:
        """The plant with one step more of it at a joint."""
        if self.effect:
            mine = [s for s in plant.effects if (s.id, s.joint) == (self.effect, joint)]
            kept = tuple(s for s in plant.effects if s not in mine)
            values = dict(mine[0].parameters if mine else self.at)
            values[self.parameter] = values.get(self.parameter, 0.0) + self.step
            return replace(plant, effects=(*kept, EffectSpec(self.effect, joint, values)))
        return replace(plant, joints={**plant.joints, joint: self._moved(plant.joints[joint])})

    def _moved(self, numbers: JointParameters) -> JointParameters:
        if self.number.startswith(_PROFILE):
            place = int(self.number.removeprefix(_PROFILE)) - 1
            profile = list(numbers.friction_profile)
            profile += [0.0] * (place + 1 - len(profile))
            profile[place] += self.step
            return replace(numbers, friction_profile=tuple(profile))
        value = getattr(numbers, self.number)
        added = self.step * value if self.scaled else self.step
        changed: dict[str, Any] = {self.number: min(value + added, NUMBERS[self.number].high)}
        return replace(numbers, **changed)


_PROFILE = 'friction_profile_'


def _number(name: str, step: float, drift: float = 0.0, spread: float = 0.0) -> Direction:
    row = NUMBERS[name]
    spread = spread or (HEALTHY if row.scaled else row.spread)
    return Direction(name, step, spread / step, drift, name, row.scaled)


def _profile(k: int) -> Direction:
    return Direction(f'{_PROFILE}{k}', 0.4, 0.75 / k, number=f'{_PROFILE}{k}')


CELL_STEP, GAIN_STEP, TRACKER_STEP, EFFORT_STEP = 0.3, 0.15, 0.05, 0.003
"""Of a cell's zero in N and its gain, and of the zeros of tracker (rad) and torque (N m)."""
_SLIP, _LONG_SLIP = 2e-4, 6e-4
_CONTACT = 0.004
"""N m/rad."""

READ = (
    Direction('cell_zero_pos', CELL_STEP, 0.2, 0.05),
    Direction('cell_zero_neg', CELL_STEP, 0.2, 0.05),
    Direction('cell_gain_pos', GAIN_STEP, 0.15, 0.03),
    Direction('cell_gain_neg', GAIN_STEP, 0.15, 0.03),
    Direction('tracker', TRACKER_STEP, 0.5, 0.03),
    Direction('effort', EFFORT_STEP, 1.0, 0.1),
)
"""Of the sensors: follow from what they read."""
# A wire of 3000 N/m that slips by 0.2 mm loses 0.6 N. A long slip is no multiple of it: the
# wire slackens for part of the motion.
SLIPS = (
    Direction('slip_pos', _SLIP, 0.8, 0.15),
    Direction('slip_neg', _SLIP, 0.8, 0.15),
    Direction('long_slip_pos', _LONG_SLIP),
    Direction('long_slip_neg', _LONG_SLIP),
    Direction('long_slip_both', _LONG_SLIP),
)
SLIPPED = ((0,), (1,), (0,), (1,), (0, 1))
"""Of the state: wires that have got longer since they were tightened, and which of the two."""
CONTACTS = tuple(
    Direction(
        f'contact_at_{angle:+.2f}_rad',
        *(_CONTACT, 0.1, 0.03),
        effect='contact',
        parameter='stiffness',
        at={'angle_rad': angle},
    )
    for angle in (-0.7, -0.4, -0.15, 0.15, 0.4, 0.7)
)
SIMULATED = (
    _number('capstan_exponent', 0.2, 0.03),
    Direction('tight_tube', 0.7, number='capstan_exponent', scaled=True),
    _number('joint_friction', 0.3, 0.03),
    _number('section_friction', 0.3, 0.03),
    _number('section_straight_angle', 0.05),
    *CONTACTS,
    Direction('gear_backlash', 0.1, 0.03, 0.01, effect='gear_backlash', parameter='gap_rad'),
    _number('wire_stiffness', 0.1, 0.03),
    _number('joint_stiffness', 0.1, 0.03),
    _number('joint_rest_angle', 0.05, 0.05, 0.03),
    _number('joint_presliding', 0.1, 0.03),
    _number('joint_presliding_spread', 0.5),
    _number('joint_radius', 0.02),
    _number('pulley_radius', 0.02),
    *(_profile(k) for k in (1, 2, 3, 4, 5, 6, 8)),
    _number('pretension_profile', -0.2, 0.0, 0.15),
)
"""Of the plant behind the motor."""
SERVO = (
    Direction('servo_lag', 0.03, effect='actuator_lag', parameter='time_constant_s'),
    _number('motor_bandwidth', 0.1, 0.02),
    _number('motor_damping_ratio', 0.1, 0.02),
)
"""Of the motor itself."""
DIRECTIONS = (*READ, *SLIPS, *SIMULATED, *SERVO)
"""All D of a joint, in the order of every array."""


@dataclass(frozen=True)
class Change:
    """A change that can be reported: its directions and its typical size."""

    name: str  # in words
    part: Part
    along: tuple[str, ...]
    usual: float  # steps: typical of the effect in the catalogue
    one_way: bool = True


CHANGES = (
    Change('zero of the positive cell', Part.CELL, ('cell_zero_pos',), 1.0, False),
    Change('zero of the negative cell', Part.CELL, ('cell_zero_neg',), 1.0, False),
    Change('gain of the positive cell', Part.CELL, ('cell_gain_pos',), 1.0, False),
    Change('gain of the negative cell', Part.CELL, ('cell_gain_neg',), 1.0, False),
    Change('zero of the tracker', Part.TRACKER, ('tracker',), 1.0, False),
    Change('slip of the positive wire', Part.WIRE, ('slip_pos',), 2.5),
    Change('slip of the negative wire', Part.WIRE, ('slip_neg',), 2.5),
    Change('pretension', Part.WIRE, ('slip_pos', 'slip_neg'), 2.5, False),
    Change('slip of the positive wire', Part.WIRE, ('long_slip_pos',), 0.83),
    Change('slip of the negative wire', Part.WIRE, ('long_slip_neg',), 0.83),
    Change('pretension', Part.WIRE, ('long_slip_both',), 0.83),
    Change('friction of the sheath', Part.SHEATH, ('capstan_exponent',), 3.0, False),
    Change('friction of the sheath', Part.SHEATH, ('tight_tube',), 0.86),
    Change('friction of the joint', Part.JOINT, ('joint_friction',), 2.0, False),
    Change('friction of the bending section', Part.JOINT, ('section_friction',), 2.0, False),
    *(Change('contact', Part.JOINT, (direction.name,), 2.5) for direction in CONTACTS),
    Change('backlash of the gear', Part.ACTUATOR, ('gear_backlash',), 1.0),
    Change('lag of the servo', Part.ACTUATOR, ('servo_lag',), 1.0),
)
"""All K changes that are reported of a joint."""

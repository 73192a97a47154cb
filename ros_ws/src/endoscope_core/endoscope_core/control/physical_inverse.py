"""Feed-forward by the inverse of the identified plant, one joint, causal and without delay."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.control.physical_inverse_law import (
    FORESEEN,
    JOINT_MEMORY,
    MEMORY,
    SENSE,
    SPEED_BEFORE,
    TARGET,
    TURN,
    law_step,
)
from endoscope_core.control.physical_parameters import PhysicalParameters
from endoscope_core.effects import distributed_friction
from endoscope_core.effects.distributed_friction import NODES
from endoscope_core.effects.slots import (
    JOINT,
    JOINT_SLIDE,
    SLIDE_A,
    SLIDE_B,
    WIRE_END,
)
from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription
from endoscope_core.plant.inputs import IN_MOTOR, INPUTS
from endoscope_core.plant.kernel import advance_tick
from endoscope_core.plant.packing import pack, rest_state

Array = NDArray[np.float64]

MODEL_SUBSTEPS = 3
LONGEST_STEP = 0.005
_JOINT_NAME = 'bend_x'


@dataclass(frozen=True)
class PhysicalInverseSettings:
    """How the physical inverse moves.

    Parameters
    ----------
    turn_lead : float
        s before a turning point at which the rest of the dead zone is crossed.
    share : float
        Of the tip motion that the release of the friction can carry, how much is counted on; 0
        crosses the whole dead zone at the turning point.
    """

    turn_lead: float = 0.05
    share: float = 0.9

    def __post_init__(self) -> None:
        if not 0.0 <= self.turn_lead <= 0.3:
            raise ValueError(f'turn_lead = {self.turn_lead} s must lie in [0, 0.3]')
        if not 0.0 <= self.share <= 1.5:
            raise ValueError(f'share = {self.share} must lie in [0, 1.5]')


class InternalModel:
    """The nominal plant of one joint, advanced by the commands that went out.

    Parameters
    ----------
    parameters : PhysicalParameters
    motor, joint, slide : float
        Where it begins: motor and tip angle (rad), sliding state of wires and joint in [-1, 1].
    """

    def __init__(
        self, parameters: PhysicalParameters, motor: float, joint: float, slide: float
    ) -> None:
        along = EffectSpec(
            distributed_friction.DEFINITION.id, _JOINT_NAME, {'share': parameters.evenness}
        )
        effects = (along,) if parameters.evenness > 0.0 else ()
        packed, flags = pack(
            PlantDescription(joints={_JOINT_NAME: parameters.joint}, effects=effects)
        )
        self.packed: Array = packed[0]
        self.flags = flags[0]
        self._evenness = parameters.evenness
        # Where friction is not spread, the law must not find the effect's typical share.
        self.packed[distributed_friction.SHARE] = parameters.evenness
        states, histories = rest_state(self.packed[None], np.array([motor]))
        self.state: Array = states[0]
        self.history: Array = histories[0]
        self.state[JOINT] = self.state[WIRE_END] = joint
        self.state[SLIDE_A], self.state[SLIDE_B] = slide, -slide
        self.state[JOINT_SLIDE] = slide
        lengths = np.array([distributed_friction.length(self.packed, i) for i in range(NODES + 1)])
        stretch = parameters.joint.joint_radius * (motor - joint) * lengths
        for wire, sign in ((distributed_friction.WIRE_A, 1.0), (distributed_friction.WIRE_B, -1.0)):
            first = wire + distributed_friction.STRETCH
            self.state[first : first + NODES + 1] = sign * stretch
            first = wire + distributed_friction.SLIDE
            self.state[first : first + NODES] = sign * slide
        self._input = np.zeros(INPUTS)
        self._input[IN_MOTOR] = np.nan

    def change_joint(self, joint: JointParameters) -> None:
        """Go on as another joint behind a tube as even, from where this one is."""
        values = astuple(joint)
        self.packed[: len(values)] = values

    def copy_as(self, parameters: PhysicalParameters) -> InternalModel:
        """Another joint in the state of this one."""
        other = InternalModel(parameters, 0.0, 0.0, 0.0)
        other.state[:] = self.state
        other.history[:] = self.history
        return other

    @property
    def tip(self) -> float:
        """Tip angle, rad."""
        return float(self.state[JOINT])

    @property
    def slide(self) -> float:
        """State of the positive wire, mean along the sheath."""
        ends = float(self.state[SLIDE_A])
        if self._evenness == 0.0:
            return ends
        first = distributed_friction.WIRE_A + distributed_friction.SLIDE
        along = float(np.mean(self.state[first : first + NODES]))
        return ends + self._evenness * (along - ends)

    def advance(self, command: float, dt: float) -> None:
        """Hold a command (rad, joint-equivalent) for `dt` s."""
        pieces = max(1, int(np.ceil(dt / LONGEST_STEP)))
        for _ in range(pieces):
            advance_tick(
                self.state,
                self.history,
                self.packed,
                self.flags,
                command,
                self._input,
                dt / pieces,
                MODEL_SUBSTEPS * max(1, round(dt / pieces / 1e-3)),
            )


class PhysicalInverse:
    """The law of `physical_inverse_law` with the internal model that it asks.

    Parameters
    ----------
    parameters : PhysicalParameters
        Of the plant, identified or of the tube's class.
    settings : PhysicalInverseSettings, optional
    """

    def __init__(
        self, parameters: PhysicalParameters, settings: PhysicalInverseSettings | None = None
    ) -> None:
        self.parameters = parameters
        self.settings = settings or PhysicalInverseSettings()
        self.model = InternalModel(parameters, 0.0, 0.0, 0.0)
        self._memory = np.zeros(MEMORY)

    @property
    def direction(self) -> float:
        """Which way the wires have slid, in [-1, 1]."""
        return self.model.slide

    @property
    def servo_lag(self) -> float:
        """Time in s by which the servo follows a steady motion late, ``2 zeta / w``."""
        return (
            2.0 * self.parameters.joint.motor_damping_ratio / self.parameters.joint.motor_bandwidth
        )

    def begin(self, direction: float, desired: float, velocity: float, command: float) -> float:
        """Start from an estimate of where things are; return the command wanted now (rad).

        Parameters
        ----------
        direction : float
            Way that the desired motion has taken, in [-1, 1].
        desired, velocity : float
            rad and rad/s.
        command : float
            rad, last one that went out.
        """
        self.model = InternalModel(self.parameters, command, desired, direction)
        self._memory = np.zeros(MEMORY)
        self._memory[SENSE] = np.sign(direction)
        self._memory[SPEED_BEFORE] = velocity
        self._memory[FORESEEN] = desired + self.servo_lag * velocity
        self._memory[JOINT_MEMORY] = direction
        self._memory[TARGET] = command
        self._memory[TURN] = desired + self.settings.turn_lead * velocity
        return self.would_want(desired, velocity)

    def would_want(self, desired: float, velocity: float) -> float:
        """Command (rad) for a desired angle and velocity, without going on."""
        return self._law(desired, velocity, 1e-3, self._memory.copy())

    def wanted(self, desired: float, velocity: float, dt: float) -> float:
        """Command (rad) for a desired angle (rad) and velocity (rad/s) `dt` s after the last."""
        return self._law(desired, velocity, dt, self._memory)

    def sent(self, command: float, dt: float) -> None:
        """What went out in the end, in force for `dt` s."""
        self.model.advance(command, dt)

    def _law(self, desired: float, velocity: float, dt: float, memory: Array) -> float:
        return float(
            law_step(
                self.model.packed,
                memory,
                desired,
                velocity,
                self.model.tip,
                self.model.slide,
                self.servo_lag,
                self.settings.turn_lead,
                self.settings.share,
                dt,
            )
        )

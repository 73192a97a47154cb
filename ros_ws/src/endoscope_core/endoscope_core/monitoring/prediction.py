"""Predicted readings of a described rig, and of each possible change, along its measured motion.

The motor is predicted from what it is sent to; wires and joint from where the motor was measured,
so that a slow servo is not taken for a tight tube. Behind the motor hardly anything depends on the
rate, so that ticks of 5 ms suffice; the state continues from block to block.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.monitoring.rig_change import (
    CELL_STEP,
    DIRECTIONS,
    EFFORT_STEP,
    GAIN_STEP,
    READ,
    SERVO,
    SIMULATED,
    SLIPPED,
    SLIPS,
    TRACKER_STEP,
)
from endoscope_core.physics import layout
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.packing import pack, rest_state
from endoscope_core.physics.servo import turn_motor
from endoscope_core.physics.sheath import TABLE_ROWS

JOINT_TICK_S = 5e-3
SERVO_TICK_S = 1e-3
READINGS = ('tension_pos', 'tension_neg', 'effort', 'bending')
"""Behind the motor."""
_OUT = [layout.OUT_TENSION_A, layout.OUT_TENSION_B, layout.OUT_EFFORT, layout.OUT_BENDING]
_PLACE = {direction.name: 1 + k for k, direction in enumerate(DIRECTIONS)}
_COPIES = slice(1 + len(READ), 1 + len(READ) + len(SLIPS) + len(SIMULATED))


@compiled
def follow_setpoint(
    x: Array,
    history: Array,
    table: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    setpoint: Array,
    tick: float,
    out: Array,
) -> None:
    """Turn a motor alone after `setpoint` (N,) in rad; `out` (N,) is its angle before each tick."""
    # The wires do not move with it: a torque that is limited is that of the wires at rest.
    inputs[layout.IN_MOTOR] = np.nan
    for n in range(len(setpoint)):
        out[n] = x[layout.MOTOR]
        inputs[layout.IN_COMMAND] = setpoint[n]
        place = int(x[layout.TICKS]) % layout.HISTORY
        history[layout.COMMAND_HISTORY, place] = setpoint[n]
        turn_motor(x, history, table, p, on, inputs, tick)
        x[layout.TICKS] += 1.0


class _Copies:
    """Variants of one joint side by side."""

    def __init__(self, plants: Sequence[PlantDescription], joint: int, tick: float) -> None:
        packed = [pack(plant) for plant in plants]
        self._parameters = np.array([p[joint] for p, _ in packed])
        self._on = np.array([on[joint] for _, on in packed])
        self._tick = tick
        self.rest(0.0)

    def rest(self, shaft: float) -> None:
        """Begin from rest with the shaft at an angle in rad."""
        angles = np.full(len(self._parameters), shaft)
        self.states, self._histories, self._sheaths = rest_state(
            self._parameters, self._on, self._tick, angles
        )

    @property
    def arrays(self) -> tuple[Array, Array, Array, Array, Flags]:
        return self.states, self._histories, self._sheaths, self._parameters, self._on


class PredictionBank:
    """Readings of a described rig of J joints, and their derivatives by all D directions.

    Derivatives are differences to a copy of the plant that is one step off, so they are of the
    size of a real change.
    """

    def __init__(self, plant: PlantDescription) -> None:
        self._parameters, self._on = pack(plant)
        self._behind, self._servos = [], []
        for j, name in enumerate(plant.joint_names()):
            behind = [plant] * len(SLIPS) + [d.changed(plant, name) for d in SIMULATED]
            self._behind.append(_Copies(behind, j, JOINT_TICK_S))
            servos = [plant, *(d.changed(plant, name) for d in SERVO)]
            self._servos.append(_Copies(servos, j, SERVO_TICK_S))
        self.rest(np.zeros(len(self._behind)))

    def rest(self, shaft: NDArray[np.float64]) -> None:
        """Begin from rest at shaft angles (J,) in rad."""
        self._nominal = rest_state(self._parameters, self._on, JOINT_TICK_S, shaft)
        for j, copies in enumerate(self._behind):
            copies.rest(float(shaft[j]))
            for k, (slip, wires) in enumerate(zip(SLIPS, SLIPPED, strict=True)):
                for wire in wires:
                    # What is wound up beyond the turn of the pulley is released in the first tick.
                    copies.states[k, layout.TRAVEL + wire] += slip.step
            self._servos[j].rest(float(shaft[j]))

    def behind_motors(self, shaft: Array) -> Array:
        """Readings behind the motors at measured shaft angles (N, J) in rad, every `JOINT_TICK_S`.

        (J, N + 1, 4, 1 + D): `READINGS` (N, N, N m, rad) as predicted, then their derivatives by a
        step of each direction. Row k is before angle k is reached.
        """
        joints, ticks = shaft.shape[1], len(shaft)
        inputs = np.zeros((joints, ticks, layout.INPUTS))
        inputs[:, :, layout.IN_MOTOR] = shaft.T
        out = np.empty((joints, ticks + 1, layout.OUTPUTS))
        # Leaves each joint's angle in the other's input.
        run_joints(*self._nominal, self._parameters, self._on, inputs, True, JOINT_TICK_S, out)
        result = np.zeros((joints, ticks + 1, len(READINGS), 1 + len(DIRECTIONS)))
        for j, copies in enumerate(self._behind):
            count = len(copies.states)
            varied = np.empty((count, ticks + 1, layout.OUTPUTS))
            own = np.repeat(inputs[j : j + 1], count, axis=0)
            run_joints(*copies.arrays, own, False, JOINT_TICK_S, varied)
            nominal, at = out[j][:, _OUT], result[j]
            at[:, :, 0] = nominal
            at[:, :, _COPIES] = np.moveaxis(varied[:, :, _OUT] - nominal, 0, -1)
            for wire, name in enumerate(('pos', 'neg')):
                at[:, wire, _PLACE[f'cell_zero_{name}']] = CELL_STEP
                at[:, wire, _PLACE[f'cell_gain_{name}']] = GAIN_STEP * nominal[:, wire]
            at[:, READINGS.index('effort'), _PLACE['effort']] = EFFORT_STEP
            at[:, READINGS.index('bending'), _PLACE['tracker']] = TRACKER_STEP
        return result

    def motors(self, setpoint: Array) -> Array:
        """Shaft angles of motors that are sent to setpoints (N, J), in rad, every `SERVO_TICK_S`.

        (J, N, 1 + D) in rad, as `behind_motors`; row k is before setpoint k is in force.
        """
        result = np.zeros((len(self._servos), len(setpoint), 1 + len(DIRECTIONS)))
        inputs = np.zeros(layout.INPUTS)
        for j, copies in enumerate(self._servos):
            x, h, s, p, on = copies.arrays
            angles = np.empty((len(x), len(setpoint)))
            column = np.ascontiguousarray(setpoint[:, j])
            for k, out in enumerate(angles):
                follow_setpoint(
                    *(x[k], h[k], s[k, :TABLE_ROWS], p[k], on[k]),
                    *(inputs, column, SERVO_TICK_S, out),
                )
            result[j, :, 0] = angles[0]
            for k, direction in enumerate(SERVO):
                result[j, :, _PLACE[direction.name]] = angles[1 + k] - angles[0]
        return result

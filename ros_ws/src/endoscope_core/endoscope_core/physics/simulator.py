"""The simulated rig: tick by tick for a node, or a whole command at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.physics import layout
from endoscope_core.physics.description import PlantDescription
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.packing import pack, rest_state

TICK = 1.0e-3
LARGEST_COMMAND = 1.0e6
BEYOND = f'{LARGEST_COMMAND:g} rad'

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlantSample:
    """What the noise-free sensors read at one instant, for J joints: s, rad, rad/s, N m and N."""

    time: float  # s since the start
    # Of the motor, (J,), in rad, rad/s and N m.
    shaft_position: Array
    shaft_velocity: Array
    shaft_effort: Array
    tension: Array  # (J, 2), load cells of the positive and the negative wire, N
    bending: Array  # (J,), rad, as the tracker reads it
    bending_true: Array  # (J,), rad, of the joint itself


@dataclass(frozen=True)
class PlantTrajectory:
    """`PlantSample` at N ticks: `time` (N,), the others (N, J) and `tension` (N, J, 2).

    Row k is the state at `time[k]`, before command k acts.
    """

    time: Array
    shaft_position: Array
    shaft_velocity: Array
    shaft_effort: Array
    tension: Array
    bending: Array
    bending_true: Array


class PlantSimulator:
    """A rig that is advanced by ticks of `tick` s; ValueError if the plant is not valid."""

    def __init__(self, plant: PlantDescription, tick: float = TICK) -> None:
        self.joints = plant.joint_names()
        self.tick = tick
        self._parameters, self._on = pack(plant)
        self._states, self._histories, self._sheaths = rest_state(self._parameters, self._on, tick)
        self._ticks = 0
        # A tick of a node makes no arrays.
        self._of_a_tick = self._arrays(1)
        self._advance(np.zeros(len(self.joints)), 0)

    @property
    def sample(self) -> PlantSample:
        """What the noise-free sensors read now."""
        out = self._readings
        return PlantSample(
            self._ticks * self.tick,
            out[:, layout.OUT_MOTOR].copy(),
            out[:, layout.OUT_MOTOR_SPEED].copy(),
            out[:, layout.OUT_EFFORT].copy(),
            out[:, layout.OUT_TENSION_A : layout.OUT_TENSION_B + 1].copy(),
            out[:, layout.OUT_BENDING].copy(),
            out[:, layout.OUT_JOINT].copy(),
        )

    def advance(self, shaft_command: ArrayLike, n_ticks: int = 1) -> PlantSample:
        """Hold a command (J,) in rad of the shafts for some ticks, and read at their end.

        ValueError if it has another shape, is not finite or beyond `LARGEST_COMMAND`; the plant
        stays as it was.
        """
        command = np.asarray(shaft_command, dtype=float)
        if command.shape != (len(self.joints),):
            raise ValueError(f'a command for {self.joints} has shape {command.shape}')
        if not all(abs(angle) <= LARGEST_COMMAND for angle in command.tolist()):
            raise ValueError(f'the command {command} is not finite or beyond {BEYOND}')
        self._advance(command, n_ticks)
        return self.sample

    def _advance(self, command: Array, n_ticks: int) -> None:
        inputs, out = self._of_a_tick if n_ticks == 1 else self._arrays(n_ticks)
        inputs[:, :, layout.IN_COMMAND] = command[:, None]
        arrays = (self._states, self._histories, self._sheaths, self._parameters, self._on)
        run_joints(*arrays, inputs, True, self.tick, out)
        self._readings = out[:, -1]
        self._ticks += n_ticks

    def _arrays(self, n_ticks: int) -> tuple[Array, Array]:
        inputs = np.zeros((len(self.joints), n_ticks, layout.INPUTS))
        inputs[:, :, layout.IN_MOTOR] = np.nan
        return inputs, np.empty((len(self.joints), n_ticks + 1, layout.OUTPUTS))


def simulate(
    plant: PlantDescription,
    shaft_command: ArrayLike,
    tick: float = TICK,
    start_shaft: ArrayLike | None = None,
) -> PlantTrajectory:
    """Answer of a rig of J joints, at rest at first, to a whole command, by ticks of `tick` s.

    Command k of shaft angles (N, J) in rad is in force from tick k to tick k + 1; `start_shaft`
    (J,) in rad is where the rig rests before, by default at zero. ValueError if the command has
    another shape or is not finite, or the plant is not valid.
    """
    command = np.asarray(shaft_command, dtype=float)
    joints = len(plant.joints)
    if command.ndim != 2 or command.shape[1] != joints or not len(command):
        raise ValueError(f'a command for {joints} joints has shape {command.shape}')
    if not (np.abs(command) <= LARGEST_COMMAND).all():
        raise ValueError(f'the command is not finite or beyond {BEYOND}')
    parameters, on = pack(plant)
    start = None if start_shaft is None else np.asarray(start_shaft, dtype=float)
    states, histories, sheaths = rest_state(parameters, on, tick, start)
    inputs = np.zeros((joints, len(command), layout.INPUTS))
    inputs[:, :, layout.IN_COMMAND] = command.T
    inputs[:, :, layout.IN_MOTOR] = np.nan
    out = np.empty((joints, len(command), layout.OUTPUTS))
    run_joints(states, histories, sheaths, parameters, on, inputs, True, tick, out)
    by_time = out.transpose(1, 0, 2)
    return PlantTrajectory(
        tick * np.arange(len(command), dtype=np.float64),
        by_time[:, :, layout.OUT_MOTOR],
        by_time[:, :, layout.OUT_MOTOR_SPEED],
        by_time[:, :, layout.OUT_EFFORT],
        by_time[:, :, layout.OUT_TENSION_A : layout.OUT_TENSION_B + 1],
        by_time[:, :, layout.OUT_BENDING],
        by_time[:, :, layout.OUT_JOINT],
    )

"""Recordings of our own simulated rig, for tests of the engine."""

from types import SimpleNamespace

import numpy as np
import pytest

from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.sensing import SensorModel
from endoscope_core.physics.simulator import simulate
from endoscope_core.rig import shipped_rig
from endoscope_explain.recording import BENDING, COMMAND, MOTOR, WIRES, Recording, Series


def short_motion(duration: float = 12.0) -> np.ndarray:
    """Desired bending (N,) in rad: sinusoid, steps with holds, chirp."""
    t = np.arange(int(duration * 1000)) * 1e-3
    sinusoid = 1.2 * np.sin(2.0 * t)
    steps = 0.5 * np.sign(np.sin(2.5 * (t - 5.0)))
    chirp = 0.7 * np.sin(1.5 * (t - 9.0) ** 2)
    return np.where(t < 5.0, sinusoid, np.where(t < 9.0, steps, chirp))


def record(plant: PlantDescription, command: np.ndarray, seed: int = 1) -> Recording:
    """What a rig's sensors read that is asked to bend: (N,), or (N, joints)."""
    joints = plant.joint_names()
    shaft = command.reshape(len(command), len(joints)) * shipped_rig().joints.gear
    answer = simulate(plant, shaft)
    sensors = SensorModel(plant.sensors, seed)
    slow = slice(None, None, 25)
    return Recording(
        'simulated',
        0.0,
        joints,
        Series.of(COMMAND, answer.time, shaft),
        Series.of(WIRES, answer.time, sensors.tension(answer.tension)),
        Series.of(BENDING, answer.time[slow], sensors.bending(answer.bending[slow])),
        Series.of(MOTOR, answer.time, sensors.shaft_position(answer.shaft_position)),
        Series.of(MOTOR, answer.time, sensors.shaft_velocity(answer.shaft_velocity)),
        Series.of(MOTOR, answer.time, sensors.shaft_effort(answer.shaft_effort)),
    )


def rig(*effects, **changed: float) -> PlantDescription:
    """A rig with one joint, with effects and other parameters than nominal."""
    return PlantDescription(joints={'bend_x': JointParameters(**changed)}, effects=tuple(effects))


@pytest.fixture(scope='session')
def one_joint():
    """Makes rigs of one joint, motions and recordings of them."""
    return SimpleNamespace(rig=rig, record=record, motion=short_motion)

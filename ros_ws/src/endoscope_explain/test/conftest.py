"""Recordings of the plant made in memory."""

import numpy as np
import pytest

from endoscope_core.plant import PlantDescription, SensorModel, simulate
from endoscope_explain.recording import Recording, Series

TICK = 1e-3
TRACKER_EVERY = 25


def make_recording(
    plant: PlantDescription | None = None, duration: float = 12.0, seed: int = 1
) -> Recording:
    """Sensors' readings of a plant whose joints are swept, stepped and held."""
    plant = plant or PlantDescription()
    n = int(duration / TICK)
    time = TICK * np.arange(n)
    joints = plant.joint_names()
    gear = np.array([plant.joints[j].gear for j in joints])
    swept = 0.9 * np.sin(1.3 * time)
    stepped = np.where((time % 3.0) < 1.5, 0.5, -0.4)
    command = np.stack([swept if k == 0 else stepped for k in range(len(joints))], axis=1) * gear
    truth = simulate(plant, command)
    sensors = SensorModel(plant.sensors, seed)
    tracker = slice(None, None, TRACKER_EVERY)
    return Recording(
        'synthetic', 0.0, joints,
        Series.of('motor/servo_jp', time, command),
        Series.of('wires/measured_js', time, sensors.tension(truth.tension)),
        Series.of('slave/measured_js', time[tracker], sensors.bending(truth.bending[tracker])),
        Series.of('motor/measured_js', time, sensors.shaft_position(truth.shaft_position)),
        Series.of('motor/measured_js', time, sensors.shaft_velocity(truth.shaft_velocity)),
        Series.of('motor/measured_js', time, sensors.shaft_effort(truth.shaft_effort)),
    )


@pytest.fixture(scope='session')
def record():
    """The function `make_recording`."""
    return make_recording

"""Noise and resolution of the sensors."""

import math

import numpy as np
import pytest

from endoscope_core.physics import SensorModel, SensorParameters

SENSORS = SensorParameters()
MANY = np.full(200_000, 3.0)


@pytest.mark.parametrize(
    ('name', 'rms', 'step'),
    [
        ('tension', SENSORS.load_cell_noise, SENSORS.load_cell_resolution),
        ('bending', SENSORS.tracker_noise, 0.0),
        ('shaft_effort', SENSORS.effort_noise, SENSORS.effort_resolution),
    ],
)
def test_noise_has_its_rms_and_readings_their_steps(name, rms, step):
    readings = getattr(SensorModel(SENSORS, 1), name)(MANY)
    mean_step = step / math.sqrt(12.0)
    assert readings.mean() == pytest.approx(3.0, abs=step / 2 + 5 * rms / math.sqrt(len(MANY)))
    if step < rms:
        assert readings.std() == pytest.approx(math.hypot(rms, mean_step), rel=0.02)
    if step:
        np.testing.assert_allclose(readings / step, np.round(readings / step), atol=1e-6)


def test_the_encoder_and_its_velocity_come_in_steps_without_noise():
    model = SensorModel(SENSORS, 1)
    angle = model.shaft_position(np.linspace(-1.0, 1.0, 50))
    counts = angle * 4096 / (2.0 * math.pi)
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert np.abs(angle - np.linspace(-1.0, 1.0, 50)).max() <= math.pi / 4096
    np.testing.assert_allclose(
        model.shaft_velocity([0.011, 0.013, -0.03]), [0.0, 0.02397, -0.02397]
    )


def test_a_seed_repeats_and_another_does_not():
    readings = [SensorModel(SENSORS, seed).tension(MANY[:100]) for seed in (7, 7, 8)]
    np.testing.assert_array_equal(readings[0], readings[1])
    assert not np.array_equal(readings[0], readings[2])


def test_sensors_draw_apart_from_each_other():
    quiet, busy = SensorModel(SENSORS, 3), SensorModel(SENSORS, 3)
    busy.bending(MANY)
    np.testing.assert_array_equal(quiet.tension(MANY[:50]), busy.tension(MANY[:50]))

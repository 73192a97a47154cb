"""Inverse of plants with effects, by iteration through the simulator."""

import numpy as np
import pytest

from endoscope_core.control.iterated_inverse import iterated_inverse
from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription, simulate
from endoscope_core.signals import periodic_signal

SIGNAL = periodic_signal()
TIME = np.arange(0.0, SIGNAL.duration, 1e-3)
STEADY = (SIGNAL.steady[0] <= TIME) & (SIGNAL.steady[1] > TIME)
ANGLE, VELOCITY = (values[:, None] for values in SIGNAL(TIME))


def plant(*effects):
    """One joint with effects (id, parameters)."""
    specs = tuple(EffectSpec(effect_id, 'bend_x', given) for effect_id, given in effects)
    return PlantDescription(joints={'bend_x': JointParameters()}, effects=specs)


def error_deg(of, command):
    """Rms error in degrees of a plant's tip under a joint-equivalent command."""
    gear = of.joints['bend_x'].gear
    tip = simulate(of, gear * command).bending_true
    return np.rad2deg(np.sqrt(np.mean((tip - ANGLE)[STEADY] ** 2)))


@pytest.mark.parametrize(
    'effect',
    [
        ('gravity', {}),
        ('joint_backlash', {'gap_rad': 0.15, 'loaded_tip': 1.0}),
    ],
)
def test_an_effect_is_inverted_with_the_plant(effect):
    slave = plant(effect)
    without = iterated_inverse(plant(), ANGLE, VELOCITY)
    with_it = iterated_inverse(slave, ANGLE, VELOCITY)
    assert error_deg(plant(), without.command) < 1.5
    assert error_deg(slave, with_it.command) < 0.65 * error_deg(slave, without.command)


def test_what_is_expected_is_what_the_plant_does():
    slave = plant(('gravity', {}))
    planned = iterated_inverse(slave, ANGLE, VELOCITY, iterations=5)
    tip = simulate(slave, slave.joints['bend_x'].gear * planned.command).bending_true
    np.testing.assert_array_equal(tip, planned.bending)
    assert planned.rmse == pytest.approx(np.sqrt(np.mean((tip - ANGLE) ** 2)))


def test_an_angle_that_cannot_be_reached_does_not_wind_the_command_up():
    slave = plant(('joint_stop', {'angle_rad': 0.4, 'stiffness': 2.0}))
    planned = iterated_inverse(slave, ANGLE, VELOCITY)
    assert np.abs(planned.command - ANGLE).max() <= 4.0
    assert np.abs(planned.bending).max() < 0.45


@pytest.mark.parametrize(
    ('angle', 'velocity', 'says'),
    [
        (ANGLE[:, 0], VELOCITY[:, 0], 'bend_x has angles'),
        (np.hstack([ANGLE, ANGLE]), np.hstack([VELOCITY, VELOCITY]), 'bend_x has angles'),
        (np.full_like(ANGLE, np.nan), VELOCITY, 'not finite'),
    ],
)
def test_a_motion_that_does_not_fit_is_refused(angle, velocity, says):
    with pytest.raises(ValueError, match=says):
        iterated_inverse(plant(), angle, velocity)

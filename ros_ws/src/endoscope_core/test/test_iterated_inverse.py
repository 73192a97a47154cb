"""Inverse of plants with effects, by iteration through the simulator."""

import numpy as np
import pytest

from endoscope_core.control.iterated_inverse import iterated_inverse
from endoscope_core.control.limits import shipped_limits
from endoscope_core.physics.description import EffectSpec, JointParameters, PlantDescription
from endoscope_core.physics.simulator import simulate
from endoscope_core.signals import periodic_signal

GEAR = shipped_limits().gear
SIGNAL = periodic_signal().scaled(0.8)
TIME = np.arange(0.0, SIGNAL.duration, 1e-3)
STEADY = (SIGNAL.steady[0] <= TIME) & (SIGNAL.steady[1] > TIME)
ANGLE, VELOCITY = (values[:, None] for values in SIGNAL(TIME))


def plant(*effects):
    """One joint with effects (id, parameters)."""
    specs = tuple(EffectSpec(effect_id, 'bend_x', given) for effect_id, given in effects)
    return PlantDescription(joints={'bend_x': JointParameters()}, effects=specs)


def error_deg(of, command):
    """Rms error in degrees of a plant's tip under a joint-equivalent command."""
    tip = simulate(of, GEAR * command).bending_true
    return np.rad2deg(np.sqrt(np.mean((tip - ANGLE)[STEADY] ** 2)))


def test_an_effect_is_inverted_with_the_plant():
    heavy = plant(('gravity', {}))
    without = iterated_inverse(plant(), ANGLE, VELOCITY)
    with_it = iterated_inverse(heavy, ANGLE, VELOCITY)
    assert error_deg(plant(), without.command) < 0.2
    assert error_deg(heavy, without.command) > 3.0
    assert error_deg(heavy, with_it.command) < 0.3


def test_what_is_expected_is_what_the_plant_does():
    slave = plant(('gravity', {}))
    planned = iterated_inverse(slave, ANGLE, VELOCITY, iterations=5)
    tip = simulate(slave, GEAR * planned.command).bending_true
    np.testing.assert_array_equal(tip, planned.bending)
    assert planned.rmse == pytest.approx(np.sqrt(np.mean((tip - ANGLE) ** 2)))


def test_an_angle_that_cannot_be_reached_does_not_wind_the_command_up():
    tight = PlantDescription(joints={'bend_x': JointParameters(capstan_exponent=1.8)})
    planned = iterated_inverse(tight, ANGLE, VELOCITY, iterations=5)
    assert np.abs(planned.command).max() <= 3.0
    assert 0.4 < np.abs(planned.bending).max() < 0.8


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

"""Friction of gear and motor."""

import numpy as np
from physics_rig import hand, run

COMMAND = hand(3000, 1e-3)


def test_effort_takes_it_on_with_the_sign_of_the_speed():
    torque, speed = 0.004, 0.02
    nominal = run(COMMAND)
    given = {'torque_nm': torque, 'speed_rad_per_s': speed, 'viscous': 1e-3}
    rubbed = run(COMMAND, {'gear_friction': given})
    expected = torque * np.tanh(nominal.speed / speed) + 1e-3 * nominal.speed
    np.testing.assert_allclose(rubbed.effort - nominal.effort, expected, atol=1e-15)


def test_nothing_behind_the_motor_feels_it():
    nominal, rubbed = run(COMMAND), run(COMMAND, {'gear_friction': {'torque_nm': 0.05}})
    for name in ('motor', 'a', 'b', 'bending'):
        np.testing.assert_array_equal(getattr(nominal, name), getattr(rubbed, name))

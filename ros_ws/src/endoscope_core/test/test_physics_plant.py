"""What an endoscope does and never does, and answers that were made elsewhere."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from outside_data import CASES, needs
from scipy.interpolate import CubicSpline

from endoscope_core.physics import JointParameters, PlantDescription, simulate

REFERENCE = CASES / 'sheath' / 'reference'
TICK = 1e-3
TIME = np.arange(0.0, 3.0, TICK)
TUBES = {
    'nominal': JointParameters(),
    'tight': JointParameters(capstan_exponent=2.2, pretension=3.0),
    'of another form': JointParameters(
        friction_profile=(0.4, -0.3), joint_presliding_spread=0.7, pretension_profile=0.3
    ),
    'loose': JointParameters(pretension=1.0, capstan_exponent=0.4),
}


def shaft_command(amplitude_deg, rate=1.0, time=TIME):
    return 0.5 * np.deg2rad(amplitude_deg) * np.sin(rate * time)[:, None]


def run(joint, command, tick=TICK):
    return simulate(PlantDescription(joints={'bend_x': joint}), command, tick)


@pytest.mark.parametrize('joint', TUBES.values(), ids=TUBES)
def test_a_coarse_tick_costs_little(joint):
    coarse = np.arange(0.0, 8.0, 5 * TICK)
    command = shaft_command(60.0, time=coarse) + shaft_command(10.0, 7.0, coarse)
    fine = run(joint, np.repeat(command, 5, axis=0))
    assert_allclose(
        run(joint, command, 5 * TICK).bending_true, fine.bending_true[::5], atol=np.deg2rad(0.05)
    )


def test_nothing_moves_before_it_is_moved():
    made = run(replace(JointParameters(), joint_rest_angle=0.2), np.zeros((500, 1)))
    # Wires and friction hold the joint near the angle at which the wires were tightened.
    assert 0.0 < made.bending_true[0, 0] < 0.1
    assert np.ptp(made.bending_true) < 1e-5
    assert_allclose(made.tension, 5.0, rtol=1e-2)


def test_a_held_shaft_holds_everything():
    command = np.concatenate([shaft_command(60.0), np.full((3000, 1), shaft_command(60.0)[-1])])
    made = run(JointParameters(), command)
    assert np.ptp(made.bending_true[-2000:]) < np.deg2rad(0.02)
    assert np.ptp(made.tension[-2000:], axis=0).max() < 2e-3


@needs(REFERENCE)
def test_answers_made_elsewhere():
    for path in sorted(REFERENCE.glob('*.csv')):
        differs = re.findall(r'(\w+)=([-\d.e]+)', path.read_text().split(';', 1)[0])
        joint = replace(JointParameters(), **{key: float(value) for key, value in differs})
        table = np.loadtxt(path, delimiter=',', skiprows=2)
        time = np.arange(10 * (len(table) - 1) + 1) * TICK
        made = run(joint, CubicSpline(table[:, 0], table[:, 1])(time)[:, None])
        off = made.bending_true[::10, 0] - table[:, 7]
        assert np.sqrt(np.mean(off**2)) < np.deg2rad(0.01), path.name
        assert np.max(np.abs(off)) < np.deg2rad(0.03), path.name
        assert np.sqrt(np.mean((made.tension[::10, 0] - table[:, 3:5]) ** 2)) < 0.02, path.name

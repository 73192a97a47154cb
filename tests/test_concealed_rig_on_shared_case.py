"""The generator's rig driven by the commands of a recording made elsewhere, where there is one."""

import os
from pathlib import Path

import numpy as np
import pytest

from endoscope_bags import open_bag
from endoscope_explain.generator.concealed_physics import move
from endoscope_explain.generator.rig import nominal_rig

SHARED = Path(os.environ.get('ENDOSCOPE_SHARED', Path(__file__).parents[2] / 'shared'))
CASE = SHARED / 'cases' / 'nominal.second.mcap'

pytestmark = pytest.mark.skipif(
    not CASE.exists(), reason=f'no {CASE}; set ENDOSCOPE_SHARED to where the cases are'
)


def test_a_nominal_rig_leaves_only_the_noise_of_the_sensors():
    bag = open_bag(CASE)
    shaft = bag.joint_state('motor/servo_jp').require('position')
    motion = move(nominal_rig(), np.vstack([shaft, shaft[-1:]]))
    tension = bag.joint_state('wires/measured_js').require('effort') - motion.tension[1:]
    np.testing.assert_allclose(tension.std(axis=0), 0.02, rtol=0.03)
    bending = bag.joint_state('slave/measured_js').require('position') - motion.bending[1::25]
    np.testing.assert_allclose(np.degrees(bending.std(axis=0)), 0.25, rtol=0.12)
    step = 2.0 * np.pi / 4096.0
    encoder = bag.joint_state('motor/measured_js').require('position') - motion.shaft_angle[1:]
    # Half a step, and what a servo integrated at another step differs by.
    np.testing.assert_array_less(np.abs(encoder).max(axis=0), 0.65 * step)

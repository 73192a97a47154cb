"""Friction that does not grow with the tension."""

import numpy as np
import pytest
from physics_rig import run, sliding_ratio

RAMP = np.linspace(0.0, 0.7, 1500)


def test_a_sliding_wire_loses_what_tension_and_floor_cause():
    force = 0.6
    with_floor = run(RAMP, {'load_independent_friction': {'force_n': force}}, motor=RAMP)
    floor = force / 0.9
    (a_motor, a_joint), _ = with_floor.ends()
    assert a_motor + floor == pytest.approx((a_joint + floor) * np.exp(0.9), rel=1e-6)
    assert sliding_ratio(with_floor) > sliding_ratio(run(RAMP, motor=RAMP)) + 0.05


def test_it_brakes_wires_without_pretension_too():
    plain = {'pretension': 0.0, 'joint_stiffness': 0.1}
    free = run(RAMP, motor=RAMP, **plain)
    braked = run(RAMP, {'load_independent_friction': {'force_n': 1.0}}, motor=RAMP, **plain)
    (motor, joint), (slack, _) = braked.ends()
    assert motor - joint > 1.0 + joint * np.expm1(0.9) * 0.999
    assert free.ends()[0][1] > joint
    assert slack == pytest.approx(0.0, abs=1e-12)

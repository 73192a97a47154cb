"""Capstan friction of the bending section on the wire on the inside of its bend."""

from itertools import pairwise

import numpy as np
import pytest
from physics_rig import NOMINAL, hand, run

from endoscope_core.physics import joint
from endoscope_core.physics import layout as L
from endoscope_core.physics.description import JointParameters, PlantDescription
from endoscope_core.physics.kernel import run_joints
from endoscope_core.physics.packing import pack, rest_state

MU, STRAIGHT = 0.45, -0.15
SECTION = {'section_friction': MU, 'section_straight_angle': STRAIGHT}
TICK = 1e-3


@pytest.mark.parametrize(
    ('turns', 'inner_is_pulled'),
    [((1.2,), True), ((-1.2,), True), ((1.2, -0.1), False), ((-1.2, 0.0), False)],
)
def test_the_inner_wire_acts_with_what_the_section_leaves_of_it(turns, inner_is_pulled):
    slow = np.linspace(0.0, 1.0, 20_000)
    command = np.concatenate([a + (b - a) * slow for a, b in pairwise((0.0, *turns))])
    quick = {'joint_presliding': 1e-3, 'joint_damping': 1e-7}
    done = run(command, **SECTION, **quick)
    (_, at_a), (_, at_b) = done.ends()
    angle = done.joint[-1]
    sense = np.sign(done.joint[-1] - done.joint[-50])
    assert (sense * (angle - STRAIGHT) > 0.0) == inner_is_pulled
    left = np.exp(-MU * (angle - STRAIGHT) * sense)
    pull_a, pull_b = (left * at_a, at_b) if angle > STRAIGHT else (at_a, left * at_b)
    moment = NOMINAL['joint_radius'] * (pull_a - pull_b)
    expected = NOMINAL['joint_stiffness'] * angle + NOMINAL['joint_friction'] * sense
    assert moment == pytest.approx(expected, abs=5e-6)


def test_without_it_the_angle_at_which_the_section_is_straight_does_nothing():
    command = hand(3000, TICK)
    plain = run(command)
    other = run(command, section_straight_angle=STRAIGHT)
    np.testing.assert_array_equal(plain.states, other.states)


def test_passing_through_straight_does_not_depend_on_the_tick():
    size, coarse = 1.4, 5
    # Commands are held, as those of the coarse ticks are.
    held = np.repeat(hand(12_000, TICK, size)[::coarse], coarse)
    fine = run(held, **SECTION).bending[::coarse]
    rough = run(held[::coarse], tick=coarse * TICK, **SECTION).bending
    assert fine.min() < STRAIGHT - 0.1 < STRAIGHT + 0.1 < fine.max()
    assert np.rad2deg(np.abs(fine - rough)).max() < 0.2


@pytest.mark.parametrize('spread', [0.0, 0.7])
@pytest.mark.parametrize('size', [0.3, 1.4, -1.4])
def test_its_slope_is_exact(size, spread):
    plant = PlantDescription({'bend_x': JointParameters(**SECTION, joint_presliding_spread=spread)})
    p, on = pack(plant)
    x, histories, sheaths = rest_state(p, on, TICK)
    inputs = np.zeros((1, 600, L.INPUTS))
    inputs[0, :, L.IN_COMMAND] = np.linspace(0.0, size, 600)
    inputs[0, :, L.IN_MOTOR] = np.nan
    run_joints(x, histories, sheaths, p, on, inputs, False, TICK, np.empty((1, 600, L.OUTPUTS)))
    k = p[0, L.WIRE_STIFFNESS]
    now = joint.Tick(k, k, 0.0, p[0, L.JOINT_FRICTION], 0.0, 0.0, 0.6, TICK)

    def missing(dq):
        return joint.imbalance(x[0], sheaths[0], p[0], on[0], now, dq)

    for dq in (-3e-3, -2e-4, 2e-4, 3e-3):
        step = 1e-8
        by_difference = (missing(dq + step)[0] - missing(dq - step)[0]) / (2.0 * step)
        assert missing(dq)[1] == pytest.approx(by_difference, rel=1e-4)

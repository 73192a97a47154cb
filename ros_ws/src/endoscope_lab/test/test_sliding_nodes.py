import math
import re

import numpy as np
import pytest
from outside_data import CASES, needs
from scipy.interpolate import CubicSpline

from endoscope_lab.concealed.sliding_nodes import NOMINAL, follow, simulate
from endoscope_lab.concealed.sliding_wire import move_wire

REFERENCE = CASES / 'sheath' / 'reference'

EXPONENT = 0.9
STIFFNESS = 3000.0


def steepest_first(tension, springs, ratio):
    """Let the pair that is farthest from holding slip until it just holds, until all hold."""
    while True:
        fall = np.log(tension[:-1] / tension[1:])
        j = np.argmax(np.abs(fall))
        if abs(fall[j]) <= math.log(ratio) + 1e-11:
            return tension
        held = ratio if fall[j] > 0.0 else 1.0 / ratio
        slip = (tension[j] - held * tension[j + 1]) / (springs[j] + held * springs[j + 1])
        tension[j] -= springs[j] * slip
        tension[j + 1] += springs[j + 1] * slip


@pytest.mark.parametrize(('in_turn', 'allowed'), [(True, 1e-8), (False, 0.03)])
def test_the_nodes_end_where_the_steepest_pair_first_would_leave_them(in_turn, allowed):
    # When both ends let go in one tick, the order in which pairs slip decides a little; the
    # nodes' own answer knows no order.
    cells, ticks = 8, 300
    time = np.arange(ticks) * 0.05
    tick = np.arange(ticks)
    even, odd = tick // 2 * 2, np.maximum((tick + 1) // 2 * 2 - 1, 0)
    at_motor, at_joint = (time[even], time[odd]) if in_turn else (time, time)
    motor, joint = 0.3e-3 * np.sin(at_motor), 0.15e-3 * np.sin(1.7 * at_joint)
    along = move_wire(NOMINAL, motor, joint, cells)
    springs = np.full(cells + 1, STIFFNESS * cells)
    springs[[0, -1]] *= 2.0
    tension = along[0].copy()
    for k in range(1, ticks):
        tension[0] += springs[0] * (motor[k] - motor[k - 1])
        tension[-1] -= springs[-1] * (joint[k] - joint[k - 1])
        tension = steepest_first(tension, springs, math.exp(EXPONENT / cells))
        np.testing.assert_allclose(along[k], tension, rtol=0.0, atol=allowed)
    assert np.ptp(along[:, -1]) > 1.0


def at_hinges(mu, bend, sense):
    """Mean tension at three hinges bent alike by `bend` in all, as a share of what comes in."""
    at_each = np.exp(-1.5 * mu * sense * bend / 3.0)
    return (at_each + at_each**2 + at_each**3) / 3.0


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize('mu', [0.03, 0.45])
def test_the_inner_wire_loses_tension_at_each_hinge_where_it_is_pulled(mu, side):
    straight = -0.15
    rubbing = {'section_friction': mu, 'section_straight_angle': straight}
    plant = {**NOMINAL, **rubbing, 'joint_presliding': 1e-3, 'joint_friction': 2e-4}
    shaft = side * np.interp(np.arange(9000), [0, 4000, 9000], [0.0, 1.2, -1.0])
    _, at_joint, angle = follow(plant, shaft, 1e-3, 12)
    inner, outer = at_joint.T if side > 0.0 else at_joint.T[::-1]
    bend = side * (angle - straight)
    turn, far, row = np.argmax(bend), bend.max() - 0.02, np.arange(len(bend))
    bends = np.flatnonzero((bend > 0.2) & (bend < far - 0.01) & (row < turn))
    unbends = np.flatnonzero((bend > 0.19) & (bend < far) & (row > turn))[::-1]

    def share(rows, sense):
        rate = side * np.diff(angle, prepend=0.0)[rows] / 1e-3
        against = 0.0045 * side * angle[rows] + 2e-4 * sense + 1e-5 * rate
        return (against / 0.0008 + outer[rows]) / inner[rows]

    taken, given = share(bends, 1.0), share(unbends, -1.0)
    np.testing.assert_allclose(taken, at_hinges(mu, bend[bends], 1.0), rtol=1e-7)
    np.testing.assert_allclose(given, at_hinges(mu, bend[unbends], -1.0), rtol=1e-7)
    # At one bend, the share where it unbends is about exp(2 mu bend) times that where it bends.
    both = np.log(np.interp(bend[bends], bend[unbends], given) / taken)
    np.testing.assert_allclose(both, 2.0 * mu * bend[bends], rtol=1e-5 + 0.01 * mu)
    assert np.ptp(bend[bends]) > 0.3


@pytest.mark.parametrize('spread', [0.0, 0.8])
def test_unlike_hinges_let_go_in_turn(spread):
    plant = {**NOMINAL, 'section_friction': 0.8, 'joint_presliding_spread': spread}
    shaft = np.interp(np.arange(700), [0, 500], [0.0, 0.35])
    _, at_joint, angle = follow(plant, shaft, 1e-3, 20)
    # The first hinge, which the wire comes to, has the least angle.
    widths = 0.03 * np.exp(spread * np.array([-1.0, 0.0, 1.0]))
    state = 1.0 - np.exp(-angle[-1] / widths)
    assert 0.3 < state[1] < 0.95
    arrives = np.exp(-1.5 * 0.8 * angle[-1] / 3.0 * np.cumsum(state))
    torque = 0.0008 * (np.mean(arrives) * at_joint[-1, 0] - at_joint[-1, 1])
    assert torque == pytest.approx(0.0045 * angle[-1] + 9e-4 * np.mean(state), abs=1e-8)


def test_the_section_is_bent_through_straight_without_a_jump():
    plant = {**NOMINAL, 'section_friction': 0.8, 'section_straight_angle': 0.1}
    command = np.interp(np.arange(1601) * 5e-3, [0, 2, 6, 8], [0.0, 1.4, -1.4, 0.0])
    fine = np.interp(np.arange(8001), 5 * np.arange(1601), command)
    *_, rough = follow(plant, command, 5e-3, 12)
    *_, angle = follow(plant, fine, 1e-3, 12)
    assert angle.min() < -0.2 < 0.4 < angle.max()
    # Never faster than wires that do not stretch would have it.
    assert np.max(np.abs(np.diff(angle))) < 3.0 * np.max(np.abs(np.diff(fine)))
    np.testing.assert_allclose(rough, angle[::5], atol=np.deg2rad(0.1))


@needs(REFERENCE)
@pytest.mark.parametrize(
    'name',
    [
        'even_start_hand',
        'high_friction_nonperiodic',
        'low_friction_sine90',
        'no_joint_friction_nested',
        'nominal_hand',
        'nominal_nested',
        'nominal_sine60',
        'slack_sine90',
    ],
)
def test_reference_answers(name):
    path = REFERENCE / f'{name}.csv'
    differs = path.read_text().split(';', 1)[0]
    plant = {**NOMINAL, **{k: float(v) for k, v in re.findall(r'(\w+)=([-\d.e]+)', differs)}}
    cells = 40
    table = np.loadtxt(path, delimiter=',', skiprows=2, max_rows=401)
    time = np.arange(10 * (len(table) - 1) + 1) * 1e-3
    command = CubicSpline(table[:, 0], table[:, 1])(time)
    shaft, at_motor, at_joint, angle = (
        answer[::10] for answer in simulate(plant, command, 1e-3, cells)
    )
    # The answers' own servo is good to 1e-4 rad in slow motions, twice that in a hand's.
    np.testing.assert_allclose(shaft, table[:, 2], atol=3e-4)
    off = np.degrees(angle - table[:, 7])
    # Just after a motor turns, its tension is off by up to half a node's friction.
    half_a_node = 0.5 * plant['capstan_exponent'] / cells * np.max(at_motor)
    assert np.max(np.abs(at_motor - table[:, 3:5])) < 1.2 * half_a_node
    assert np.sqrt(np.mean((at_joint - table[:, 5:7]) ** 2)) < 0.01
    assert np.sqrt(np.mean(off**2)) < 0.01
    assert np.max(np.abs(off)) < 0.03

import math
import re

import numpy as np
import pytest
from outside_data import CASES, needs
from scipy.integrate import quad
from scipy.interpolate import CubicSpline

from endoscope_lab.concealed.sliding_nodes import NOMINAL, follow, motor_angle, simulate
from endoscope_lab.concealed.sliding_wire import move_wire

REFERENCE = CASES / 'sheath' / 'reference'

CELLS = 100
PLACE = np.linspace(0.0, 1.0, CELLS + 1)
EXPONENT = 0.9
STIFFNESS = 3000.0
EVEN = {**NOMINAL, 'pretension_profile': 0.0}


def pulled(plant, *motor, joint=None, cells=CELLS):
    """Tension along a wire at the last of the motor's displacements."""
    motor = np.array(motor)
    return move_wire(plant, motor, np.zeros(len(motor)) if joint is None else joint, cells)[-1]


def displacement(phi):
    """How far an even wire's end is pulled when friction has turned over `phi` of exponent."""
    return 5.0 / (STIFFNESS * EXPONENT) * (math.exp(phi) - 1.0 - phi)


def test_a_pulled_wire_slides_up_to_where_its_tension_has_fallen_to_the_old_one():
    tension = pulled(EVEN, 0.0, displacement(0.6))
    assert tension[0] == pytest.approx(5.0 * math.exp(0.6), abs=1e-3)
    expected = np.maximum(tension[0] * np.exp(-EXPONENT * PLACE), 5.0)
    np.testing.assert_allclose(tension, expected, atol=0.03)
    np.testing.assert_allclose(tension[expected > 5.1], expected[expected > 5.1], rtol=1e-9)
    np.testing.assert_allclose(tension[PLACE > 0.7], 5.0, rtol=1e-12)


def test_a_released_wire_slides_back_over_half_the_change():
    before = pulled(EVEN, 0.0, displacement(0.6))
    back = before[0] * (1.0 - math.exp(-0.2)) ** 2 / (STIFFNESS * EXPONENT)
    tension = pulled(EVEN, 0.0, displacement(0.6), displacement(0.6) - back)
    assert tension[0] == pytest.approx(before[0] * math.exp(-0.4), abs=3e-3)
    np.testing.assert_allclose(
        tension, np.minimum(before, tension[0] * np.exp(EXPONENT * PLACE)), atol=0.06
    )
    np.testing.assert_allclose(tension[PLACE > 0.25], before[PLACE > 0.25], rtol=1e-12)


@pytest.mark.parametrize('steps', [1, 7])
def test_a_wire_comes_back_to_where_it_turned(steps):
    out, back = 0.4e-3, 0.15e-3
    way = np.concatenate(
        [
            [0.0],
            np.linspace(out, out - back, steps + 1),
            np.linspace(out - back, out, steps + 1)[1:],
        ]
    )
    along = move_wire(NOMINAL, way, np.zeros(len(way)), CELLS)
    assert abs(along[1 + steps, 0] - along[1, 0]) > 1.0
    np.testing.assert_allclose(along[-1], along[1], atol=1e-8)
    # Beyond the turn it goes on as if it had never turned.
    np.testing.assert_allclose(
        pulled(NOMINAL, *way, 0.6e-3), pulled(NOMINAL, 0.0, out, 0.6e-3), atol=1e-8
    )


def test_a_wire_without_friction_is_a_spring():
    smooth = {**NOMINAL, 'capstan_exponent': 1e-9}
    tension = pulled(smooth, 0.0, 0.2e-3, joint=np.array([0.0, -0.1e-3]))
    np.testing.assert_allclose(tension, 5.0 + STIFFNESS * 0.3e-3, atol=1e-6)


@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_a_wire_that_slides_as_a_whole_holds_the_capstan_s_ratio(direction):
    way = direction * np.array([0.0, 3e-3])
    tension = pulled(EVEN, *way, joint=way)
    np.testing.assert_allclose(
        tension, tension[0] * np.exp(-direction * EXPONENT * PLACE), rtol=1e-9
    )
    # Moved as a whole, it is as long as it was.
    assert np.trapezoid(tension, PLACE) == pytest.approx(5.0, abs=1e-9)


def test_a_wire_pulled_at_both_ends_keeps_a_still_point():
    way = np.array([0.0, 2e-3])
    tension = pulled(EVEN, *way, joint=-way)
    np.testing.assert_allclose(tension, tension[::-1], rtol=1e-9)
    from_middle = np.abs(PLACE - 0.5) - 0.5
    np.testing.assert_allclose(tension, tension[0] * np.exp(EXPONENT * from_middle), rtol=1e-9)
    assert np.trapezoid(tension, PLACE) == pytest.approx(5.0 + STIFFNESS * 4e-3, abs=1e-8)


def test_a_slack_wire_picks_up_by_its_length():
    spare = 5.0 / STIFFNESS
    motor = np.array([0.0, -spare - 1e-3, -spare - 1e-3, -spare - 0.6e-3, -spare])
    joint = np.array([0.0, 0.0, -0.4e-3, -0.4e-3, -0.4e-3])
    along = move_wire(EVEN, motor, joint, CELLS)
    assert np.all(along[1:4] == 0.0)
    # From no tension at all the pulled end's front reaches the other end at once.
    expected = 0.4e-3 * STIFFNESS * EXPONENT / (1.0 - math.exp(-EXPONENT))
    np.testing.assert_allclose(along[4], expected * np.exp(-EXPONENT * PLACE), rtol=1e-4)
    # Whether the pick-up falls on a step or into one is all the same.
    inside = move_wire(EVEN, motor[[0, 1, 2, 4]], joint[[0, 1, 2, 4]], CELLS)
    np.testing.assert_allclose(inside[-1], along[-1], atol=1e-9)


def test_uneven_friction():
    uneven = {**NOMINAL, 'friction_profile': (1.0, -0.5), 'pretension_profile': 1.0}

    def density(s):
        return math.exp(math.cos(math.pi * s) - 0.5 * math.cos(2.0 * math.pi * s))

    share = quad(density, 0.0, 0.3)[0] / quad(density, 0.0, 1.0)[0]
    tension = pulled(uneven, 0.0, 0.0)
    assert tension[30] == pytest.approx(5.0 * math.exp(-EXPONENT * share), rel=1e-6)
    assert tension[-1] == pytest.approx(5.0 * math.exp(-EXPONENT), rel=1e-12)
    way = np.array([0.0, 0.3e-3, 0.1e-3])
    mirrored = {**EVEN, 'friction_profile': (-1.0, -0.5)}
    np.testing.assert_allclose(
        pulled({**uneven, **EVEN, 'friction_profile': (1.0, -0.5)}, *way),
        pulled(mirrored, *(0.0 * way), joint=-way)[::-1],
        atol=1e-8,
    )


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


def test_the_servo_s_response_to_a_step():
    time = np.arange(200) * 1e-3
    damped = 30.0 * math.sqrt(1.0 - 0.9**2)
    rest = np.exp(-27.0 * time) * (np.cos(damped * time) + 27.0 / damped * np.sin(damped * time))
    np.testing.assert_allclose(
        motor_angle(NOMINAL, np.full(200, 0.3), 1e-3), 0.3 * (1.0 - rest), atol=1e-12
    )


@pytest.mark.parametrize('spread', [0.0, 0.8])
def test_the_joint_comes_to_rest_where_its_torques_balance(spread):
    plant = {**NOMINAL, 'joint_presliding_spread': spread, 'joint_rest_angle': 0.02}
    shaft = 0.4 * np.clip(np.arange(700) / 500.0, 0.0, 1.0)
    at_motor, at_joint, angle = follow(plant, shaft, 1e-3, 20)
    # The rest angle pulls the joint the same way, so it never turns back.
    assert np.all(np.diff(angle) > -1e-9)
    assert angle[-1] > 0.05
    widths = 0.03 * np.exp([-spread, 0.0, spread])
    friction = 9e-4 * np.mean(1.0 - np.exp(-angle[-1] / widths))
    torque = 0.0008 * (at_joint[-1, 0] - at_joint[-1, 1])
    assert torque == pytest.approx(0.0045 * (angle[-1] - 0.02) + friction, abs=1e-8)
    assert at_motor[-1, 0] > at_joint[-1, 0]


def test_without_friction_the_joint_is_a_spring_between_springs():
    plant = {**NOMINAL, 'capstan_exponent': 1e-9, 'joint_friction': 0.0}
    shaft = np.concatenate([[0.0], np.full(300, 0.3)])
    *_, angle = follow(plant, shaft, 1e-3, 10)
    pull, bend = 2.0 * 3000.0 * 0.0008 * 0.0024, 0.0045 + 2.0 * 3000.0 * 0.0008**2
    assert angle[-1] == pytest.approx(pull * 0.3 / bend, abs=1e-8)


def test_the_two_wires_are_each_other_s_mirror():
    command = 0.7 * np.sin(np.arange(400) * 0.02)
    shaft, at_motor, at_joint, angle = simulate(NOMINAL, command, 1e-3, 20)
    turned = simulate(NOMINAL, -command, 1e-3, 20)
    for own, other in zip(
        (-shaft, at_motor[:, ::-1], at_joint[:, ::-1], -angle), turned, strict=True
    ):
        np.testing.assert_allclose(own, other, atol=1e-7)


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

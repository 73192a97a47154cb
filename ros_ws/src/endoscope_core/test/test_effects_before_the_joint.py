"""Known answers of each actuator and transmission effect."""

import numpy as np
import pytest

from endoscope_core.effects import presliding_shape
from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription, simulate

TICK = 1e-3
TIME = TICK * np.arange(4000)
SINE = 0.5 * np.deg2rad(80.0) * np.sin(2.0 * TIME)
GEAR = JointParameters().gear


def answer(command, *effects, joint=None):
    """Answer of `bend_x` to a shaft command (N,), with effects given as (id, parameters)."""
    joints = {'bend_x': joint or JointParameters()}
    specs = tuple(EffectSpec(effect_id, 'bend_x', given) for effect_id, given in effects)
    return simulate(PlantDescription(joints=joints, effects=specs), np.asarray(command)[:, None])


def step_command(height, ticks=4000, rise=200):
    """From zero to `height` within `rise` ticks, then held."""
    return height * np.clip(np.arange(ticks) / rise, 0.0, 1.0)


@pytest.mark.parametrize('ticks', [1, 37, 500])
def test_transport_delay_shifts_the_whole_answer(ticks):
    late = answer(SINE, ('transport_delay', {'delay_s': ticks * TICK}))
    prompt = answer(SINE)
    np.testing.assert_allclose(
        late.shaft_position[ticks:], prompt.shaft_position[:-ticks], atol=1e-9
    )
    np.testing.assert_allclose(late.tension[ticks:], prompt.tension[:-ticks], atol=1e-5)


def test_transport_delay_between_ticks_lies_between():
    at = [
        answer(SINE, ('transport_delay', {'delay_s': d})).shaft_position
        for d in (0.020, 0.0204, 0.021)
    ]
    np.testing.assert_allclose(at[1], 0.6 * at[0] + 0.4 * at[2], atol=5e-6)


def test_actuator_lag_is_first_order():
    stiff = JointParameters(motor_bandwidth=2000.0)
    lagged = answer(np.full(1000, 0.3), ('actuator_lag', {'time_constant_s': 0.1}), joint=stiff)
    np.testing.assert_allclose(
        lagged.shaft_position[50:, 0],
        0.3 * (1.0 - np.exp(-(TIME[50:1000] - 0.001) / 0.1)),
        atol=2e-3,
    )


def test_rate_limit_is_the_largest_speed():
    ramped = answer(np.full(3000, 1.0), ('rate_limit', {'limit_rad_per_s': 0.5}))
    assert np.abs(ramped.shaft_velocity).max() == pytest.approx(0.5, rel=1e-3)
    assert ramped.shaft_position[1500, 0] == pytest.approx(0.5 * 1.5, abs=0.02)
    assert ramped.shaft_position[-1, 0] == pytest.approx(1.0, abs=1e-6)


def test_a_slewed_command_is_the_answer_to_a_ramp():
    limited = {'limit_rad_per_s': 0.5, 'of_command': 1.0}
    slewed = answer(np.full(3000, 1.0), ('rate_limit', limited))
    ramp = answer(np.minimum(0.5 * TIME[:3000] + 0.25e-3, 1.0))
    np.testing.assert_allclose(slewed.shaft_position, ramp.shaft_position, atol=3e-4)
    # The servo itself is free to be faster where it overshoots.
    assert np.abs(slewed.shaft_velocity).max() > 0.5


def test_torque_limit_is_the_largest_effort_and_the_motor_stays_behind():
    stalled = answer(SINE, ('torque_limit', {'limit_nm': 0.03}))
    assert np.abs(stalled.shaft_effort).max() == pytest.approx(0.03, rel=1e-3)
    assert np.abs(stalled.shaft_position - answer(SINE).shaft_position).max() > 0.1


def test_a_drooping_torque_limit_leaves_a_speed_in_proportion_to_the_torque_to_spare():
    limit, droop = 0.05, 1e-3
    drooping = answer(SINE, ('torque_limit', {'limit_nm': limit, 'droop': droop}))
    effort, speed = drooping.shaft_effort[:, 0], drooping.shaft_velocity[:, 0]
    line = (limit - np.abs(effort)) / droop
    driving = effort * speed > 0.0
    assert np.all(np.abs(speed[driving]) < line[driving] + 0.02)
    # Where the sinusoid asks for more than there is, the motor is on the line.
    assert np.sum(np.abs(np.abs(speed[driving]) - line[driving]) < 0.02) > 200


def test_worn_flanks_take_over_one_after_the_other():
    ramp = np.concatenate([0.3 * TIME, 1.2 - 0.3 * TIME])

    def played(spread):
        worn = {'gap_rad': 0.1, 'flank_spread': spread}
        return answer(ramp, ('gear_backlash', worn))

    sharp, gradual = played(0.0), played(0.3)
    shaft = sharp.shaft_position[:, 0]
    turn = int(np.argmax(shaft))
    differ = np.abs(gradual.tension - sharp.tension)[:, 0, 0] > 0.02
    # The narrowest flank carries after 0.07 rad, and 0.13 rad after the turn all of them do.
    back = shaft[turn] - shaft[turn:]
    assert not differ[turn:][back < 0.068].any()
    assert differ[turn:][(back > 0.08) & (back < 0.12)].all()
    assert not differ[-300:].any()


def test_gear_backlash_has_the_width_of_its_gap():
    back_and_forth = 0.4 * np.sin(2.0 * TIME)
    played = answer(back_and_forth, ('gear_backlash', {'gap_rad': 0.1}))
    free = answer(back_and_forth)
    np.testing.assert_array_equal(played.shaft_position, free.shaft_position)
    # After a turning point the wires first notice the motor once it has crossed the gap.
    shaft = free.shaft_position[:, 0]
    turn = int(np.argmax(shaft))
    crossed = turn + int(np.argmin(np.abs(shaft[turn : turn + 1000] - shaft[turn] + 0.1)))
    assert np.ptp(played.tension[turn + 5 : crossed, 0, 0]) < 0.05
    assert np.ptp(played.tension[crossed : crossed + 100, 0, 0]) > 0.5


def test_cogging_repeats_with_the_shaft_angle():
    slow = 0.4 * TIME
    cycles = 20.0
    rippled = answer(slow, ('cogging', {'amplitude_rad': 0.01, 'cycles_per_turn': cycles}))
    shaft = rippled.shaft_position[:, 0]
    ripple = (rippled.tension - answer(slow).tension)[:, 0, 0]
    moving = shaft > 0.5
    basis = np.column_stack([np.sin(cycles * shaft), np.cos(cycles * shaft), np.ones(len(shaft))])
    fitted, *_ = np.linalg.lstsq(basis[moving], ripple[moving], rcond=None)
    left = ripple[moving] - basis[moving] @ fitted
    assert np.std(left) < 0.3 * np.std(ripple[moving])


def test_wire_slack_takes_the_tension_at_rest():
    assert answer(np.zeros(10), ('wire_slack', {'length_m': 1e-3})).tension[:, 0] == pytest.approx(
        5.0 - 2000.0 * 1e-3
    )
    slack = answer(step_command(0.05), ('wire_slack', {'length_m': 4e-3}))
    np.testing.assert_array_equal(slack.tension[0, 0], 0.0)
    # 0.05 rad of the shaft wind 0.25 mm: far from the 1.5 mm that are left to take up.
    np.testing.assert_array_equal(slack.tension, 0.0)
    assert answer(step_command(0.6), ('wire_slack', {'length_m': 4e-3})).tension.max() > 0.5


def test_pretension_loss_is_linear_in_time_and_ends_at_zero():
    left = answer(np.zeros(4000), ('pretension_loss', {'rate_n_per_s': 1.0})).tension[:, 0]
    np.testing.assert_allclose(left, np.repeat((5.0 - TIME)[:, None], 2, axis=1), atol=1e-9)
    soft = answer(
        np.zeros(4000),
        ('pretension_loss', {'rate_n_per_s': 1.0}),
        joint=JointParameters(pretension=2.0),
    )
    np.testing.assert_array_equal(soft.tension[-1000:], 0.0)


def friction_of(trajectory, row):
    """Ratio of the pulling wire's tension at the motor to what it would be without friction."""
    stretch = 0.0025 * (trajectory.shaft_position[row, 0] / GEAR - trajectory.bending[row, 0])
    return trajectory.tension[row, 0, 0] / (5.0 + 2000.0 * stretch)


def test_nominal_friction_is_the_capstan_equation():
    assert friction_of(answer(0.4 * TIME), 1500) == pytest.approx(np.exp(0.45), rel=1e-3)


@pytest.mark.parametrize('lagging', [0.0, 1.0])
@pytest.mark.parametrize(
    ('tail', 'fall'), [(0.0, lambda s: np.exp(-s)), (1.0, lambda s: 1.0 / (1.0 + s**2))]
)
def test_stribeck_friction_is_the_curve_at_steady_speed(lagging, tail, fall):
    # Damped enough to slide smoothly; v = r (m' + q') / 2.
    damped = JointParameters(joint_damping=0.05)
    given = {'rise': 0.5, 'stribeck_speed': 1e-3, 'tail': tail, 'lagging': lagging}
    effect = ('stribeck_friction', given)
    for speed in (0.1, 0.4, 0.8):
        run = answer(speed * TIME, effect, joint=damped)
        wire_speed = (
            0.5
            * 0.0025
            * (speed / GEAR + (run.bending[2500, 0] - run.bending[2480, 0]) / (20 * TICK))
        )
        expected = np.exp(0.45 * (1.0 + 0.5 * fall(wire_speed / 1e-3)))
        assert friction_of(run, 2490) == pytest.approx(expected, rel=0.02)


def test_lagging_friction_follows_the_speed_within_its_memory():
    damped = JointParameters(joint_damping=0.05)
    ramp = 0.8 * np.maximum(TIME - 2.0, 0.0) + 0.02 * TIME

    def friction(memory_s):
        given = {'rise': 0.5, 'stribeck_speed': 5e-4, 'lagging': 1.0, 'memory_s': memory_s}
        run = answer(ramp, ('stribeck_friction', given), joint=damped)
        return np.array([friction_of(run, row) for row in range(1900, 2400)])

    prompt, late = friction(1e-4), friction(5e-2)
    assert late[:50] == pytest.approx(prompt[:50], rel=2e-3)
    assert np.max(late / prompt) > 1.05
    assert late[-1] == pytest.approx(prompt[-1], rel=0.02)


def test_a_wire_shudders_where_friction_falls_too_steeply_and_loses_friction():
    held = step_command(0.4)
    smooth = JointParameters(joint_damping=0.05)

    def bent(shudder, joint):
        effect = ('stribeck_friction', {'rise': 0.8, 'shudder': shudder})
        return answer(held, effect, joint=joint).bending[600, 0]

    assert bent(2.0, JointParameters()) > bent(1.0, JointParameters()) + np.deg2rad(1.0)
    assert bent(2.0, smooth) == pytest.approx(bent(1.0, smooth), abs=np.deg2rad(0.1))


@pytest.mark.parametrize(
    ('given', 'expected'),
    [
        ({'coefficient': 300.0, 'load_factor': 0.0}, lambda t, v: 0.5 * 300.0 * v),
        (
            {'coefficient': 80.0, 'thinning': 50.0},
            lambda _, v: 40.0 * v / (1.0 + 50.0 * v),
        ),
        (
            {'coefficient': 0.0, 'load_factor': 60.0},
            lambda t, v: t * (np.exp(0.5 * 60.0 * v) - 1.0),
        ),
    ],
)
def test_viscous_friction_is_its_law_of_speed(given, expected):
    run = answer(0.4 * TIME, ('viscous_friction', given))
    row = 1500
    speed = (
        0.5
        * 0.0025
        * (0.4 / GEAR + (run.bending[row + 10, 0] - run.bending[row - 10, 0]) / (20 * TICK))
    )
    stretch = 0.0025 * (run.shaft_position[row, 0] / GEAR - run.bending[row, 0])
    dry = (5.0 + 2000.0 * stretch) * np.exp(0.45)
    assert run.tension[row, 0, 0] - dry == pytest.approx(expected(dry, speed), rel=0.02)


@pytest.mark.parametrize(
    'beside', [(), (EffectSpec('viscous_friction', 'bend_x', {'coefficient': 1.0}),)]
)
def test_sticking_and_slipping_needs_few_substeps(beside):
    # Ten times as far off where friction does not follow the speed of the very step.
    lagging = {'rise': 0.75, 'stribeck_speed': 1.8e-3, 'tail': 1.0, 'lagging': 1.0}
    effect = EffectSpec('stribeck_friction', 'bend_x', lagging)
    joints = {'bend_x': JointParameters(capstan_exponent=0.8)}
    plant = PlantDescription(joints=joints, effects=(effect, *beside))
    slow = 0.5 * np.sin(2.0 * TIME)[:, None]
    few, many = (simulate(plant, slow, substeps=n).tension[:, 0, 0] for n in (12, 100))
    smooth = simulate(PlantDescription(joints=joints), slow).tension[:, 0, 0]
    assert np.std(np.diff(many)) > 10.0 * np.std(np.diff(smooth))
    assert np.std(few - many) < 0.1


def test_wire_stiffening_is_its_law():
    # A joint that cannot bend: stretch is what the motor winds; no friction.
    blocked = JointParameters(capstan_exponent=0.0, joint_stiffness=1e6)
    given = {'growth_per_m': 60.0, 'cubic_per_m2': 2e4}
    run = answer(step_command(0.4), ('wire_stiffening', given), joint=blocked)
    stretch = 0.0025 * 0.8
    for wire, s in ((0, stretch), (1, -stretch)):
        law = 2000.0 * (np.expm1(120.0 * s) / 120.0 + 2e4 * s**3)
        assert run.tension[-1, 0, wire] == pytest.approx(5.0 + law, rel=1e-6)


def test_wire_creep_relaxes_with_its_time_constant():
    blocked = JointParameters(capstan_exponent=0.0, joint_stiffness=1e6)
    ratio, constant = 0.5, 1.0
    run = answer(
        step_command(0.2, rise=1),
        ('wire_creep', {'compliance_ratio': ratio, 'time_constant_s': constant}),
        joint=blocked,
    )
    load = run.tension[:, 0, 0] - 5.0
    whole = 2000.0 * 0.0025 * 0.4
    # At a held stretch the solid relaxes to 1 / (1 + ratio), by 1 + ratio faster than it creeps.
    settled = whole / (1.0 + ratio)
    rate = (1.0 + ratio) / constant
    row = slice(300, None)
    np.testing.assert_allclose(
        load[row], settled + (whole - settled) * np.exp(-rate * (TIME[row] - 0.035)), rtol=0.01
    )


def test_configuration_change_multiplies_the_friction_from_its_time_on():
    run = answer(0.3 * TIME, ('configuration_change', {'time_s': 2.0, 'factor': 1.5}))
    before = slice(None, 1999)
    np.testing.assert_array_equal(run.tension[before], answer(0.3 * TIME).tension[before])
    assert friction_of(run, 3000) == pytest.approx(np.exp(0.45 * 1.5), rel=1e-3)


@pytest.mark.parametrize(('smooth', 'begun'), [(0.0, 0.25), (1.0, 0.5 - 0.5 * np.cos(np.pi / 4))])
def test_configuration_change_rises_evenly_or_along_a_half_cosine(smooth, begun):
    given = {'time_s': 3.0, 'factor': 1.5, 'duration_s': 2.0, 'smooth': smooth}
    run = answer(0.3 * TIME, ('configuration_change', given))
    assert friction_of(run, 2500) == pytest.approx(np.exp(0.45 * (1.0 + 0.5 * begun)), rel=1e-3)


@pytest.mark.parametrize('gradual', [0.0, 1.0])
def test_friction_asymmetry_brakes_a_pulled_wire_more(gradual):
    given = {'asymmetry': 0.3, 'gradual': gradual}
    run = answer(0.4 * TIME, ('friction_asymmetry', given))
    stretch = 0.0025 * (run.shaft_position[1500, 0] / GEAR - run.bending[1500, 0])
    assert run.tension[1500, 0, 0] == pytest.approx(
        (5.0 + 2000.0 * stretch) * np.exp(0.45 * 1.3), rel=1e-3
    )
    assert run.tension[1500, 0, 1] == pytest.approx(
        (5.0 - 2000.0 * stretch) * np.exp(-0.45 * 0.7), rel=1e-3
    )


def test_gradual_asymmetry_grows_with_the_pre_sliding_state():
    # Half way through pre-sliding, z = 1/2: exponents phi/2 z (1 +- a z) of both wires.
    held = step_command(0.06, rise=2000)
    even = answer(held)
    uneven = answer(held, ('friction_asymmetry', {'asymmetry': 0.2, 'gradual': 1.0}))
    sharp = answer(held, ('friction_asymmetry', {'asymmetry': 0.2}))
    row = 700
    change = uneven.tension[row, 0, 0] - even.tension[row, 0, 0]
    assert 0.0 < change < 0.9 * (sharp.tension[row, 0, 0] - even.tension[row, 0, 0])


def test_friction_run_in_falls_with_the_distance_slid():
    given = {'excess': 0.6, 'distance_m': 2e-3}
    run = answer(0.4 * TIME, ('friction_run_in', given))
    speed = 0.5 * 0.0025 * np.abs(0.4 / GEAR + np.gradient(run.bending[:, 0], TICK))
    for row in (1200, 2500):
        distance = TICK * speed[:row].sum()
        expected = np.exp(0.45 * (1.0 + 0.6 * np.exp(-distance / 2e-3)))
        assert friction_of(run, row) == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize('nodes', [2, 5, 8, 12])
def test_distributed_friction_ends_at_the_same_capstan_ratio(nodes):
    given = {'share': 1.0, 'nodes': nodes, 'free_end': 0.5 / nodes}
    run = answer(0.4 * TIME, ('distributed_friction', given))
    assert run.tension[2500, 0, 0] > run.tension[2500, 0, 1]
    # Sliding everywhere, tension falls exponentially along the wire; the mean of the springs is
    # what is stretched.
    levels = np.exp(0.9 * (0.5 - np.arange(nodes + 1) / nodes))
    shares = np.array([0.5, *[1.0] * (nodes - 1), 0.5]) / nodes
    stretch = 0.0025 * (run.shaft_position[2500, 0] / GEAR - run.bending[2500, 0])
    middle = (5.0 + 2000.0 * stretch) / (shares @ levels)
    assert run.tension[2500, 0, 0] == pytest.approx(middle * np.exp(0.45), rel=1e-3)


def test_the_free_end_before_a_chain_is_the_spring_that_a_reversal_meets_first():
    # While friction holds the first node, only the wire before it is released.
    back = np.concatenate([0.4 * TIME, 1.6 - 0.4 * TIME])
    grips = JointParameters(presliding_distance=1e-5)

    def stiffness(free_end):
        given = {'share': 1.0, 'free_end': free_end}
        run = answer(back, ('distributed_friction', given), joint=grips)
        after = int(np.argmax(run.shaft_position[:, 0])) + 10
        few = slice(after, after + 2)
        return np.ptp(run.tension[few, 0, 0]) / np.ptp(run.shaft_position[few, 0])

    # The pulley winds 5 mm a radian of a wire of 2000 N/m.
    assert stiffness(0.2) == pytest.approx(0.005 * 2000.0 / 0.2, rel=0.2)
    assert stiffness(0.1) == pytest.approx(0.005 * 2000.0 / 0.1, rel=0.2)


def test_a_chain_that_turns_is_integrated_alike_with_few_and_many_substeps():
    # Every node slid freely; one that turns and is still taken to slide freely runs ahead.
    given = {'share': 1.0, 'nodes': 6.0, 'free_end': 1.0 / 7.0}
    plant = PlantDescription(
        joints={'bend_x': JointParameters(capstan_exponent=1.0, presliding_distance=9e-5)},
        effects=(EffectSpec('distributed_friction', 'bend_x', given),),
    )
    turning = 0.4 * np.sin(2.0 * TIME)[:, None]
    few, many = (simulate(plant, turning, substeps=n).tension for n in (3, 30))
    assert np.abs(few - many).max() < 1e-3


@pytest.mark.parametrize('nodes', [2, 4, 8])
def test_a_wire_in_a_chain_creeps_under_the_mean_of_its_tensions(nodes):
    held = step_command(2.4, rise=1000)
    creep = ('wire_creep', {'compliance_ratio': 0.6, 'time_constant_s': 0.5, 'slow_share': 0.0})
    chain = ('distributed_friction', {'share': 1.0, 'nodes': nodes, 'free_end': 0.5 / nodes})

    def lost(*sheath):
        stiff, soft = (answer(held, *sheath, *own).tension[-1, 0, 0] for own in ((), (creep,)))
        return stiff - soft

    # Behind the friction the joint's end of the wire has less tension than at rest, and would make
    # the whole wire shorter.
    assert 0.5 * lost() < lost(chain) < lost()


def test_distributed_friction_lets_the_joint_wait_for_the_sliding_front():
    def moves_at(*effects):
        bending = answer(step_command(0.4, rise=2000), *effects).bending[:, 0]
        return int(np.argmax(np.abs(bending) > np.deg2rad(1.0)))

    assert moves_at(('distributed_friction', {'share': 1.0})) > moves_at() + 5


def wire_travel_to(level, *effects):
    """Sliding distance (m) at which the sheath's friction has grown to a share of its full size."""
    run = answer(0.08 * TIME, *effects, joint=JointParameters(joint_stiffness=1e6))
    friction = (
        np.log(run.tension[:, 0, 0] / (5.0 + 2000.0 * 0.0025 * run.shaft_position[:, 0] / GEAR))
        / 0.45
    )
    wire = 0.5 * 0.0025 * run.shaft_position[:, 0] / GEAR
    return float(np.interp(level, friction, wire))


@pytest.mark.parametrize(('exponent', 'softer'), [(0.5, False), (2.0, True)])
def test_presliding_shape_is_sharper_or_softer_than_dahl(exponent, softer):
    shape = {'exponent': exponent, 'memory': 0.0, 'at_joint': 0.0}
    shaped = wire_travel_to(0.8, ('presliding_shape', shape))
    # z' = (1 - z)^n from 0: at z = 0.8, x / xs = (1 - 0.2^(1 - n)) / (1 - n).
    expected = 1e-4 * (1.0 - 0.2 ** (1.0 - exponent)) / (1.0 - exponent)
    assert shaped == pytest.approx(expected, rel=0.02)
    assert (shaped > wire_travel_to(0.8)) is softer


@pytest.mark.parametrize(('spread', 'reach'), [(1.0, 1.0), (1.0, 0.5), (0.3, 1.0), (2.0, 0.7)])
@pytest.mark.parametrize('level', [0.3, 0.8])
def test_slip_elements_yield_one_after_the_other(spread, reach, level):
    shape = {'exponent': 1.0, 'memory': 1.0, 'spread': spread, 'reach': reach, 'at_joint': 0.0}
    travelled = wire_travel_to(level, ('presliding_shape', shape)) / 1e-4
    # Equal elements in parallel, elastic until each yields (Iwan, J. Appl. Mech. 33(4), 1966).
    yields = reach * presliding_shape.YIELD**spread
    assert np.mean(np.minimum(1.0, travelled / yields)) == pytest.approx(level, rel=0.02)


def test_presliding_memory_closes_inner_loops():
    blocked = JointParameters(joint_stiffness=1e6)
    phase = np.arange(4000)
    # Out, a small loop back and forth, and the point where it began once more.
    way = 0.02 * np.interp(phase, [0, 1000, 2000, 3000, 4000], [0.0, 1.0, 0.6, 1.0, 1.0])

    def miss(memory):
        run = answer(
            way,
            ('presliding_shape', {'exponent': 1.0, 'memory': memory, 'at_joint': 0.0}),
            joint=blocked,
        )
        return abs(run.tension[3500, 0, 0] - np.max(run.tension[1000:1100, 0, 0]))

    assert miss(1.0) < 0.3 * miss(0.0)

"""Known answers of each joint effect."""

import numpy as np
import pytest

from endoscope_core.plant import EffectSpec, JointParameters, PlantDescription, simulate

TICK = 1e-3
TIME = TICK * np.arange(4000)
# Neither friction nor wires: the bending section alone answers to moments.
LOOSE = JointParameters(
    pretension=0.0, wire_stiffness=1e-3, joint_friction=0.0, capstan_exponent=0.0
)


def answer(command, *effects, joint=None):
    """Answer of `bend_x` to a shaft command (N,), with effects given as (id, parameters)."""
    joints = {'bend_x': joint or JointParameters()}
    specs = tuple(EffectSpec(effect_id, 'bend_x', given) for effect_id, given in effects)
    return simulate(PlantDescription(joints=joints, effects=specs), np.asarray(command)[:, None])


def still(*effects, joint=LOOSE):
    """Bending angle (4000,) of a rig whose motor rests at zero."""
    return answer(np.zeros(4000), *effects, joint=joint).bending[:, 0]


SINE = 0.5 * np.deg2rad(80.0) * np.sin(2.0 * TIME)


def test_joint_backlash_is_the_play_operator_behind_the_joint():
    gap = 0.15
    tip = answer(SINE, ('joint_backlash', {'gap_rad': gap, 'loaded_tip': 0.0}))
    joint = answer(SINE)
    expected, here = [], 0.0
    for angle in joint.bending[:, 0]:
        here = min(angle + gap / 2, max(angle - gap / 2, here))
        expected.append(here)
    np.testing.assert_allclose(tip.bending[:, 0], expected, atol=1e-12)
    np.testing.assert_array_equal(tip.tension, joint.tension)


def test_a_loaded_tip_leaves_the_wires_free_within_the_gap():
    # Without friction, in the gap the wires' pulls balance: both are at pretension, while the
    # motor crosses the gap ahead of the tip.
    smooth = JointParameters(capstan_exponent=0.0)
    run = answer(SINE, ('joint_backlash', {'gap_rad': 0.2, 'loaded_tip': 1.0}), joint=smooth)
    turn = int(np.argmax(SINE[:2000]))
    free = np.flatnonzero(np.abs(run.tension[turn : turn + 1000, 0, 0] - 5.0) < 0.01)
    assert len(free) == free[-1] - free[0] + 1
    lead = (2.0 * run.shaft_position - run.bending)[turn + free, 0]
    assert lead[0] - lead[-1] == pytest.approx(0.2, abs=0.005)


def test_flanks_give_way_by_the_moment_that_they_carry():
    rigid = {'gap_rad': 0.2, 'loaded_tip': 1.0}
    # Held by wires without friction, a spring of 0.003 N m/rad at 0.4 rad takes 0.0012 N m.
    joint = JointParameters(capstan_exponent=0.0, joint_friction=0.0, joint_stiffness=3e-3)
    held = np.full(3000, 0.5)

    def lead(given):
        run = answer(held, ('joint_backlash', given), joint=joint)
        tip, moment = run.bending[-1, 0], 3e-3 * run.bending[-1, 0]
        pull = 0.0025 * (run.tension[-1, 0, 0] - run.tension[-1, 0, 1])
        assert pull == pytest.approx(moment, rel=1e-3)
        return 2.0 * run.shaft_position[-1, 0] - tip - pull / (2.0 * 2000.0 * 0.0025**2), moment

    here, _ = lead(rigid)
    soft, moment = lead(rigid | {'flank_compliance': 10.0})
    assert here == pytest.approx(0.1, abs=1e-4)
    assert soft == pytest.approx(0.1 + 10.0 * moment, abs=1e-4)


def test_a_damped_wire_end_crosses_the_gap_slowly():
    smooth = JointParameters(capstan_exponent=0.0)
    turn = int(np.argmax(SINE[:2000]))

    def pull_and_speed(damping):
        given = {'gap_rad': 0.2, 'loaded_tip': 1.0, 'wire_end_damping': damping}
        run = answer(SINE, ('joint_backlash', given), joint=smooth)
        pull = 0.0025 * (run.tension[:, 0, 0] - run.tension[:, 0, 1])
        wire_end = 2.0 * run.shaft_position[:, 0] - pull / (2.0 * 2000.0 * 0.0025**2)
        # In the gap the tip stands still.
        crossing = np.flatnonzero(np.abs(np.gradient(run.bending[:, 0])) < 1e-7)
        inside = crossing[(crossing > turn) & (crossing < turn + 1000)][20:-20]
        return pull[inside], np.gradient(wire_end, TICK)[inside]

    assert np.abs(pull_and_speed(0.0)[0]).max() < 2e-5
    pull, speed = pull_and_speed(1e-3)
    np.testing.assert_allclose(pull, 1e-3 * speed, rtol=0.05)


STOPS = (
    ('joint_stop', {'angle_rad': 0.2, 'stiffness': 0.1}),
    ('contact', {'angle_rad': 0.2, 'stiffness': 0.1, 'exponent': 1.0}),
)


@pytest.mark.parametrize(('effect_id', 'hard'), STOPS)
def test_a_lossy_obstacle_resists_entry_and_lets_go_where_it_did(effect_id, hard):
    joint = JointParameters(joint_friction=0.0, capstan_exponent=0.0)
    plain = answer(SINE, (effect_id, hard), joint=joint).bending[:, 0]
    lossy = answer(SINE, (effect_id, hard | {'loss_s': 0.4}), joint=joint).bending[:, 0]
    rising = slice(0, int(np.argmax(SINE[:2000])))
    inside = plain[rising] > 0.21
    assert np.all(lossy[rising][inside] < plain[rising][inside])
    # Damping does not move what stands still.
    held = np.full(3000, SINE.max())
    at_rest = [
        answer(held, (effect_id, hard | {'loss_s': loss}), joint=joint).bending[-1, 0]
        for loss in (0.0, 0.4)
    ]
    assert at_rest[0] == pytest.approx(at_rest[1], abs=1e-4)


@pytest.mark.parametrize('stiffness', [0.05, 0.5])
def test_joint_stop_is_a_spring_beyond_its_angle_on_both_sides(stiffness):
    stop = ('joint_stop', {'angle_rad': 0.4, 'stiffness': stiffness})
    run = answer(SINE, stop).bending[:, 0]
    free = answer(SINE).bending[:, 0]
    assert free.max() > 0.7
    # At most the whole pull of the wires on the spring.
    largest_moment = 0.0025 * 15.0
    for reached in (run.max(), -run.min()):
        assert 0.4 < reached < 0.4 + largest_moment / stiffness
    pushed = still(stop, ('external_load', {'moment_nm': 0.01, 'time_s': 0.0}))
    expected = (0.01 + stiffness * 0.4) / (stiffness + LOOSE.joint_stiffness)
    assert pushed[-1] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize('side', [1.0, -1.0])
@pytest.mark.parametrize('exponent', [1.0, 1.5])
def test_contact_is_one_sided_and_compliant(side, exponent):
    touch = ('contact', {'angle_rad': side * 0.3, 'stiffness': 0.02, 'exponent': exponent})
    towards = side * still(touch, ('external_load', {'moment_nm': side * 0.005, 'time_s': 0.0}))
    away = side * still(touch, ('external_load', {'moment_nm': -side * 0.002, 'time_s': 0.0}))
    assert away[-1] == pytest.approx(-0.002 / 0.003, rel=1e-3)
    deep = towards[-1] - 0.3
    assert 0.003 * towards[-1] + 0.02 * deep * (deep / 0.2) ** (exponent - 1.0) == pytest.approx(
        0.005, rel=1e-3
    )


def test_gravity_bends_until_the_section_holds_it():
    angle = still(('gravity', {'moment_nm': 0.002, 'phase_rad': -1.0}))[-1]
    assert angle > 0.1
    assert 0.003 * angle == pytest.approx(-0.002 * np.sin(angle - 1.0), rel=1e-3)


def test_external_load_acts_from_its_time_on():
    angle = still(('external_load', {'moment_nm': 0.0015, 'time_s': 1.5}))
    np.testing.assert_array_equal(angle[:1500], 0.0)
    tau = 3e-4 / 0.003
    np.testing.assert_allclose(
        angle[1510:], 0.5 * (1.0 - np.exp(-(TIME[1510:] - 1.5) / tau)), atol=1e-4
    )


def test_joint_inertia_rings_at_its_frequency():
    inertia = 1e-4
    run = still(
        ('joint_inertia', {'inertia_kg_m2': inertia}),
        ('external_load', {'moment_nm': 0.0015, 'time_s': 0.0}),
    )
    omega = np.sqrt(0.003 / inertia)
    ratio = 3e-4 / (2.0 * np.sqrt(0.003 * inertia))
    damped = omega * np.sqrt(1.0 - ratio**2)
    decay = np.exp(-ratio * omega * TIME)
    sine = ratio / np.sqrt(1.0 - ratio**2) * np.sin(damped * TIME)
    np.testing.assert_allclose(run, 0.5 * (1.0 - decay * (np.cos(damped * TIME) + sine)), atol=3e-3)


def test_cross_coupling_by_moment_and_by_wire_travel():
    joints = {'bend_x': LOOSE, 'bend_y': JointParameters()}
    command = np.column_stack([np.zeros(4000), SINE])
    spec = EffectSpec('cross_coupling', 'bend_x', {'moment_per_rad': 0.001, 'wire_per_rad': 0.0})
    run = simulate(PlantDescription(joints=joints, effects=(spec,)), command)
    # The loose joint follows with c / K = 0.1 s.
    lagged = np.zeros(4000)
    for n in range(1, 4000):
        lagged[n] = lagged[n - 1] + TICK / 0.1 * (run.bending[n - 1, 1] / 3.0 - lagged[n - 1])
    np.testing.assert_allclose(run.bending[:, 0], lagged, atol=2e-3)

    blocked = JointParameters(capstan_exponent=0.0, joint_stiffness=1e6)
    joints = {'bend_x': blocked, 'bend_y': JointParameters()}
    spec = EffectSpec('cross_coupling', 'bend_x', {'moment_per_rad': 0.0, 'wire_per_rad': 0.2})
    run = simulate(PlantDescription(joints=joints, effects=(spec,)), command)
    np.testing.assert_allclose(
        run.tension[1:, 0, 0], 5.0 + 2000.0 * 0.0025 * 0.2 * run.bending[:-1, 1], atol=1e-2
    )


def test_a_single_joint_has_nothing_to_couple_to():
    coupled = answer(SINE, ('cross_coupling', {}))
    np.testing.assert_array_equal(coupled.bending, answer(SINE).bending)


def test_breathing_moves_the_joint_at_its_frequency():
    given = {'moment_nm': 0.001, 'frequency_hz': 1.5, 'phase_rad': 0.7, 'second_harmonic': 0.0}
    run = still(('breathing', given))
    omega = 2.0 * np.pi * 1.5
    gain = 1.0 / (0.003 + 1j * omega * 3e-4)
    expected = np.imag(0.001 * gain * np.exp(1j * (omega * TIME + 0.7)))
    settled = slice(1500, None)
    np.testing.assert_allclose(run[settled], expected[settled], atol=2e-4)


def test_breathing_with_its_second_harmonic_is_lujans_fourth_power():
    given = {
        'moment_nm': 0.5,
        'frequency_hz': 0.5,
        'phase_rad': np.pi / 2,
        'second_harmonic': -0.25,
    }
    stiff = JointParameters(joint_stiffness=50.0, capstan_exponent=0.0, joint_friction=0.0)
    with pytest.raises(ValueError, match='moment_nm'):
        still(('breathing', given), joint=stiff)
    given['moment_nm'] = 0.1
    angle = still(('breathing', given), joint=stiff)
    fourth_power = np.cos(np.pi * 0.5 * TIME) ** 4
    correlation = np.corrcoef(angle[100:], fourth_power[100:])[0, 1]
    assert correlation > 0.9999


def test_soft_flanks_and_a_viscous_sheath_stay_bounded():
    # The wire end must not be carried along by a tip that moves away from soft flanks.
    soft = ('joint_backlash', {'gap_rad': 1.5, 'loaded_tip': 1.0, 'flank_compliance': 1.0})
    viscous = ('viscous_friction', {'coefficient': 0.0, 'load_factor': 500.0})
    jumping = np.repeat([0.5, 0.0, 0.5, 0.0], 50)
    for quick in (JointParameters(), JointParameters(motor_bandwidth=120.0)):
        run = answer(jumping, soft, viscous, joint=quick)
        assert np.abs(run.bending).max() < 2.0

"""What the effects of motor, wires and sheaths do, one by one."""

import numpy as np
import pytest
from physics_rig import BLOCKED, hand, run, sliding_ratio
from scipy.linalg import expm

TICK = 1e-3
COMMAND = hand(4000, TICK)
QUICK = {'motor_bandwidth': 1e4, 'motor_damping_ratio': 1.0}
"""A servo that is where its command is."""
PHI = 0.9


def ramp(speed, way=0.7):
    """Shaft angles of an even motion in rad at rad/s."""
    return np.arange(0.0, way, speed * TICK)


def slid(effects, speed=1.0):
    """Capstan exponent that a wire shows while it is pulled, as a share of the nominal one."""
    shaft = ramp(speed)
    return sliding_ratio(run(shaft, effects, motor=shaft)) / PHI


# Motor


@pytest.mark.parametrize('ticks', [20, 7.25])
def test_transport_delay_delays_by_its_time(ticks):
    late = run(COMMAND, {'transport_delay': {'delay_s': ticks * TICK}}, **QUICK)
    nominal = run(COMMAND, **QUICK)
    now = np.arange(4000.0)
    expected = np.interp(now - ticks, now, nominal.motor)
    np.testing.assert_allclose(late.motor, expected, atol=2e-4)
    assert np.abs(late.motor - nominal.motor).max() > 0.005


def test_before_the_first_command_the_motor_rests_where_it_is():
    late = run(np.full(100, 0.5), {'transport_delay': {'delay_s': 0.05}}, start=0.2, **QUICK)
    np.testing.assert_allclose(late.motor[:51], 0.2, atol=1e-12)
    np.testing.assert_allclose(late.motor[52:], 0.5, atol=1e-3)


def test_actuator_lag_is_an_exponential():
    time = TICK * np.arange(300)
    lag = {'actuator_lag': {'time_constant_s': 0.05}}
    step = run(np.full(300, 0.4), lag, start=0.1, **QUICK)
    np.testing.assert_allclose(step.motor, 0.4 - 0.3 * np.exp(-time / 0.05), atol=5e-3)
    still = run(np.full(50, 0.1), lag, start=0.1)
    np.testing.assert_allclose(still.motor, 0.1, atol=1e-12)


@pytest.mark.parametrize('of_command', [0.0, 1.0])
def test_rate_limit_is_reached_and_not_passed(of_command):
    limit = {'rate_limit': {'limit_rad_per_s': 0.5, 'of_command': of_command}}
    jump = run(np.full(1500, 0.4), limit)
    assert jump.speed.max() == pytest.approx(0.5, rel=0.01)
    assert jump.motor[-1] == pytest.approx(0.4, abs=1e-3)
    assert run(np.full(1500, 0.4)).speed.max() > 2.0


def test_torque_limit_stalls_the_motor():
    stalled = run(COMMAND, {'torque_limit': {'limit_nm': 0.01}})
    nominal = run(COMMAND)
    assert np.abs(nominal.effort).max() > 0.015
    assert np.abs(stalled.effort).max() == pytest.approx(0.01, rel=1e-3)
    assert stalled.motor.max() < nominal.motor.max() - 0.05


def test_a_motor_bears_less_the_quicker_it_turns():
    limits = {'limit_nm': 0.012, 'droop': 0.005}
    stalled = run(COMMAND, {'torque_limit': limits})
    # What has just been read is what the joint has given way to after the motor's step.
    driving = np.maximum(0.0, stalled.speed * np.sign(stalled.effort))
    room = limits['limit_nm'] - limits['droop'] * driving - np.abs(stalled.effort)
    pulling = driving > 0.05
    assert room[pulling].min() > -2e-4
    assert room[pulling].min() < 1e-4


def test_gear_backlash_is_as_wide_as_it_says():
    shaft = np.concatenate([np.linspace(0.0, 0.5, 501), np.linspace(0.499, -0.1, 600)])
    done = run(shaft, {'gear_backlash': {'gap_rad': 0.1}}, motor=shaft)
    back = done.a[511:] - done.a[511]
    free = np.flatnonzero(np.abs(back) > 2e-3)[0] + 511 - 501
    assert free == pytest.approx(100, abs=3)


# Wires


def test_slack_is_taken_up_before_a_wire_pulls():
    shaft = ramp(0.5, 0.6)
    loose = run(shaft, {'wire_slack': {'length_m': 2e-3}}, motor=shaft)
    assert loose.a[0] == loose.b[0] == 0.0
    pulls = shaft[np.flatnonzero(loose.a > 0.0)[0]]
    rest = 5.0 * -np.expm1(-0.75 * PHI) / (0.75 * PHI)
    assert pulls == pytest.approx((2e-3 - rest / 3000.0) / 0.0024, rel=0.01)
    assert np.abs(loose.joint[shaft < 0.9 * pulls]).max() < 1e-9


def test_a_short_dead_length_takes_its_share_of_the_pretension():
    rest = 5.0 * -np.expm1(-0.75 * PHI) / (0.75 * PHI)
    loose = run(np.zeros(10), {'wire_slack': {'length_m': 4e-4}})
    assert loose.a[-1] == pytest.approx(5.0 * (1.0 - 1.2 / rest), rel=1e-3)


def test_pretension_falls_at_its_rate():
    lost = run(np.zeros(10_000), {'pretension_loss': {'rate_n_per_s': 0.05}})
    assert lost.a[-1] == pytest.approx(5.0 - 0.05 * 10.0, abs=1e-3)
    quick = {'rate_n_per_s': 0.2, 'span_s': 10.0, 'time_constant_s': 2.0}
    early = run(np.zeros(10_000), {'pretension_loss': quick})
    assert early.a[-1] == pytest.approx(3.0, abs=1e-3)
    assert early.a[2000] == pytest.approx(5.0 - 2.0 * np.expm1(-1.0) / np.expm1(-5.0), abs=2e-3)


@pytest.mark.parametrize(('growth', 'cubic'), [(200.0, 0.0), (0.0, 1e6), (150.0, 5e5)])
def test_stiffening_wires_follow_their_curve_and_come_back(growth, cubic):
    way = 0.35 * np.sin(2.0 * np.pi * np.arange(2000) / 500.0)
    given = {'growth_per_m': growth, 'cubic_per_m2': cubic}
    stiff = run(way, {'wire_stiffening': given}, motor=way, **BLOCKED)
    s = 0.0024 * way[:-1]
    curve = np.expm1(2.0 * growth * s) / (2.0 * growth) if growth else s
    expected = 5.0 + 3000.0 * (curve + cubic * s**3)
    np.testing.assert_allclose(stiff.a[1:], expected, atol=5e-3)
    assert np.ptp(stiff.a) > 1.01 * np.ptp(3000.0 * s)


@pytest.mark.parametrize('tick', [1e-3, 1e-2])
def test_creep_lowers_a_held_tension_in_its_time(tick):
    ratio, tau = 0.5, 0.4
    creeping = {'wire_creep': {'compliance_ratio': ratio, 'time_constant_s': tau}}
    held = np.full(round(3.0 / tick), 0.3)
    done = run(held, creeping, tick, motor=held, **BLOCKED)
    time = tick * np.arange(len(held))
    load = 3000.0 * 0.0024 * 0.3
    left = (1.0 + ratio * np.exp(-(1.0 + ratio) * time / tau)) / (1.0 + ratio)
    # One tick passes before a wire that has been pulled begins to creep.
    np.testing.assert_allclose(done.a[2:], 5.0 + load * left[1:-1], atol=0.003)


def test_two_elements_of_creep_share_what_they_yield():
    quick, slow, taus = 0.3, 0.5, (0.1, 1.0)
    given = {'compliance_ratio': quick + slow, 'slow_share': slow / (quick + slow)}
    given |= dict(zip(('time_constant_s', 'slow_time_constant_s'), taus, strict=True))
    held = np.full(3000, 0.3)
    done = run(held, {'wire_creep': given}, motor=held, **BLOCKED)
    rates = np.array([[-(1.0 + quick), -quick], [-slow, -(1.0 + slow)]]) / np.array(taus)[:, None]
    end = -np.linalg.solve(rates, np.array([quick, slow]) / taus)
    for tick in (300, 1000, 2999):
        crept = end - expm(rates * tick * TICK) @ end
        expected = 5.0 + 3000.0 * 0.0024 * 0.3 * (1.0 - crept.sum())
        assert done.a[tick] == pytest.approx(expected, abs=0.01)


def test_wires_at_rest_do_not_creep():
    rest = run(np.zeros(2000), {'wire_creep': {}}, friction_profile=(0.7, -0.3))
    assert np.ptp(rest.a) < 1e-9


# Sheath


def test_nominal_friction_is_the_capstan_exponent_at_any_speed():
    assert slid({}) == pytest.approx(1.0, abs=1e-9)
    assert slid({}, speed=0.05) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ('tail', 'curve'), [(0.0, lambda r: np.exp(-r)), (1.0, lambda r: 1 / (1 + r * r))]
)
@pytest.mark.parametrize('speed', [0.1, 0.5, 2.0])
def test_stribeck_friction_falls_with_speed(tail, curve, speed):
    given = {'rise': 0.6, 'stribeck_speed': 1e-3, 'tail': tail}
    ratio = 0.0024 * speed / 1e-3
    found = slid({'stribeck_friction': given}, speed)
    assert found == pytest.approx(1.0 + 0.6 * curve(ratio), rel=1e-6)


def test_stribeck_friction_does_not_hang_on_the_tick():
    def answer(tick):
        shaft = 0.5 * np.sin(1.3 * tick * np.arange(round(6.0 / tick)))
        done = run(shaft, {'stribeck_friction': {'rise': 1.0}}, tick, motor=shaft)
        return done.bending[:: round(0.01 / tick)]

    assert np.abs(answer(1e-3) - answer(5e-4)).max() < np.deg2rad(0.2)
    assert np.abs(answer(5e-3) - answer(5e-4)).max() < np.deg2rad(1.5)


def test_viscous_friction_grows_with_speed():
    found = slid({'viscous_friction': {'coefficient': 0.0, 'load_factor': 50.0}}, 1.0)
    assert found == pytest.approx(1.0 + 50.0 * 0.0024 / PHI, rel=1e-6)

    def film(speed, **given):
        shaft = ramp(speed, 0.6)
        viscous = {'viscous_friction': {'coefficient': 100.0} | given}
        return run(shaft, viscous, motor=shaft).a[-1] - run(shaft, motor=shaft).a[-1]

    assert film(0.5) > 0.02
    assert film(1.0) == pytest.approx(2.0 * film(0.5), rel=0.05)
    assert film(1.0, thinning=1e3) < 0.6 * film(1.0)


def test_a_configuration_change_comes_at_its_time():
    change = {'configuration_change': {'time_s': 0.4, 'factor': 1.5}}
    assert slid(change, 1.0) == pytest.approx(1.5, rel=1e-6)
    assert slid({'configuration_change': {'time_s': 5.0, 'factor': 1.5}}) == pytest.approx(1.0)


def test_where_friction_falls_wires_slip_and_where_it_rises_they_do_not():
    shaft = np.concatenate([ramp(1.0, 0.5), np.full(1500, 0.5)])

    def held(factor):
        change = {'configuration_change': {'time_s': 1.0, 'factor': factor}}
        return run(shaft, change, motor=shaft)

    falls, rises = held(0.4), held(2.5)
    assert np.ptp(rises.a[900:]) < 1e-3
    assert falls.a[1500] < falls.a[950] - 0.3
    assert falls.joint[1500] > falls.joint[950] + 0.02


def test_friction_asymmetry_is_that_of_pull_and_release():
    shaft = ramp(1.0, 0.4)
    done = run(shaft, {'friction_asymmetry': {'asymmetry': 0.3}}, motor=shaft)
    (a_motor, a_joint), (b_motor, b_joint) = done.ends()
    assert np.log(a_motor / a_joint) == pytest.approx(1.3 * PHI, rel=1e-6)
    assert np.log(b_joint / b_motor) == pytest.approx(0.7 * PHI, rel=1e-6)


@pytest.mark.parametrize('tail', [0.0, 0.5])
def test_friction_runs_in_with_the_way(tail):
    given = {'excess': 0.8, 'distance_m': 4e-4, 'tail': tail}
    shaft = ramp(1.0)
    done = run(shaft, {'friction_run_in': given}, motor=shaft)
    # Half of what pulley and joint have moved; the joint's share is read from its angle.
    way = 0.5 * (0.0024 * shaft[-1] + 0.0008 * done.joint[-1]) / 4e-4
    left = (1.0 + tail * way) ** (-1.0 / tail) if tail else np.exp(-way)
    assert sliding_ratio(done) / PHI == pytest.approx(1.0 + 0.8 * left, rel=0.01)


RAMP = np.linspace(0.0, 0.7, 1500)


def test_a_sliding_wire_loses_what_tension_and_floor_cause():
    force = 0.6
    with_floor = run(RAMP, {'load_independent_friction': {'force_n': force}}, motor=RAMP)
    floor = force / 0.9
    (a_motor, a_joint), _ = with_floor.ends()
    assert a_motor + floor == pytest.approx((a_joint + floor) * np.exp(0.9), rel=1e-6)
    assert sliding_ratio(with_floor) > sliding_ratio(run(RAMP, motor=RAMP)) + 0.05


def test_friction_without_tension_brakes_wires_without_pretension_too():
    plain = {'pretension': 0.0, 'joint_stiffness': 0.1}
    free = run(RAMP, motor=RAMP, **plain)
    braked = run(RAMP, {'load_independent_friction': {'force_n': 1.0}}, motor=RAMP, **plain)
    (motor, joint), (slack, _) = braked.ends()
    assert motor - joint > 1.0 + joint * np.expm1(0.9) * 0.999
    assert free.ends()[0][1] > joint
    assert slack == pytest.approx(0.0, abs=1e-12)

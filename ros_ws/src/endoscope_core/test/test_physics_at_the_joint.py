"""What the effects of the bending joint do, one by one."""

import numpy as np
import pytest
from physics_rig import LOOSE, hand, run

TICK = 1e-3
TIME = TICK * np.arange(4000)
COMMAND = hand(4000, TICK)
STIFFNESS = 0.0045


def still(effects, **plant):
    """Bending angle (4000,) of a section that answers to moments alone."""
    return run(np.zeros(4000), effects, **(LOOSE | plant)).bending


def test_joint_backlash_is_the_play_operator_behind_the_joint():
    gap = 0.15
    tip, joint = run(COMMAND, {'joint_backlash': {'gap_rad': gap}}), run(COMMAND)
    expected, here = [], 0.0
    for angle in joint.bending:
        here = min(angle + gap / 2, max(angle - gap / 2, here))
        expected.append(here)
    np.testing.assert_allclose(tip.bending, expected, atol=1e-12)
    np.testing.assert_array_equal(tip.a, joint.a)


def test_a_stop_stops_on_both_sides():
    free = run(COMMAND).bending
    stopped = run(COMMAND, {'joint_stop': {'angle_rad': 0.1, 'stiffness': 1.0}})
    assert free.max() > 0.14
    assert free.min() < -0.14
    # Wires of 10 N at 0.8 mm press it less than 0.01 rad into a stop of 1 N m/rad.
    assert 0.1 < stopped.bending.max() < 0.11
    assert -0.11 < stopped.bending.min() < -0.1


def test_a_stop_with_loss_brakes_what_comes_and_does_not_hold_what_goes():
    load = {'moment_nm': 0.003, 'time_s': 0.5, 'duration_s': 0.0}
    stop = {'angle_rad': 0.2, 'stiffness': 0.02}
    light = {'joint_damping': 1e-4}
    plain = still({'external_load': load, 'joint_stop': stop}, **light)
    lossy = still({'external_load': load, 'joint_stop': stop | {'loss_s': 0.5}}, **light)
    rest = (0.003 + 0.02 * 0.2) / (0.02 + STIFFNESS)
    assert plain[-1] == pytest.approx(rest, rel=1e-3)
    assert lossy[-1] == pytest.approx(rest, rel=1e-3)
    assert lossy[510:560].max() < plain[510:560].max() - 1e-3


def test_contact_presses_from_one_side():
    free = run(COMMAND).bending
    touch = run(COMMAND, {'contact': {'angle_rad': 0.1, 'stiffness': 0.05}}).bending
    first = int(np.argmax(free > 0.1))
    np.testing.assert_array_equal(touch[:first], free[:first])
    assert 0.1 < touch.max() < free.max() - 0.05
    other = run(COMMAND, {'contact': {'angle_rad': -0.1, 'stiffness': 0.05}}).bending
    assert -0.17 < other.min() < -0.1


@pytest.mark.parametrize('exponent', [1.0, 1.5, 2.5])
def test_contact_carries_what_its_depth_says(exponent):
    load = {'moment_nm': 0.003, 'time_s': 0.5}
    touch = {'angle_rad': 0.2, 'stiffness': 0.02, 'exponent': exponent}
    angle = still({'external_load': load, 'contact': touch})[-1]
    deep = angle - 0.2
    moment = 0.02 * deep * (deep / 0.2) ** (exponent - 1.0)
    assert moment + STIFFNESS * angle == pytest.approx(0.003, rel=1e-6)


@pytest.mark.parametrize('smooth', [0.0, 1.0])
def test_an_external_load_comes_at_its_time(smooth):
    load = {'moment_nm': 9e-4, 'time_s': 2.0, 'duration_s': 0.4, 'smooth': smooth}
    angle = still({'external_load': load})
    assert np.abs(angle[TIME < 1.8]).max() < 1e-12
    assert angle[2000] == pytest.approx(0.1, abs=0.003)
    np.testing.assert_allclose(angle[TIME > 2.25], 0.2, atol=1e-4)
    quarter = 0.25 if smooth == 0.0 else 0.5 - 0.5 * np.cos(np.pi / 4.0)
    assert angle[1903] == pytest.approx(0.2 * quarter, abs=0.004)


def test_inertia_rings_at_its_frequency():
    ring = {'joint_inertia': {'inertia_kg_m2': 1e-5}}
    load = {'external_load': {'moment_nm': 9e-4, 'time_s': 0.01}}
    done = run(np.zeros(4000), ring | load, 2.5e-4, **(LOOSE | {'joint_damping': 1e-6}))
    above = done.bending > 0.2
    crossings = np.flatnonzero(above[1:] & ~above[:-1])
    period = 2.0 * np.pi * np.sqrt(1e-5 / STIFFNESS)
    np.testing.assert_allclose(np.diff(crossings) * 2.5e-4, period, rtol=0.02)
    assert done.bending.max() > 0.35


def test_the_other_joint_winds_up_this_ones_wires():
    wires = {'cross_coupling': {'moment_per_rad': 0.0, 'wire_per_rad': 0.3}}
    smooth = {'capstan_exponent': 0.0, 'joint_friction': 0.0}
    bent = run(np.zeros(500), wires, other=0.4, **smooth)
    by_wires = 2.0 * 3000.0 * 0.0008**2
    expected = by_wires * 0.3 * 0.4 / (by_wires + STIFFNESS)
    assert bent.bending[-1] == pytest.approx(expected, rel=1e-4)
    assert bent.a[-1] - 5.0 == pytest.approx(3000.0 * 0.0008 * (0.12 - expected), rel=1e-4)


LONG = TICK * np.arange(8000)
FULL = 9e-4 / STIFFNESS
LOAD = {'moment_nm': 9e-4, 'time_s': 1.0}


def bent(**given):
    """Bending angle (8000,) of a section under a load that goes and comes again."""
    return run(np.zeros(8000), {'external_load': LOAD | given}, **LOOSE).bending


def test_a_load_goes_when_it_has_been_held():
    angle = bent(hold_s=2.0)
    np.testing.assert_allclose(angle[(LONG > 1.1) & (LONG < 2.99)], FULL, atol=1e-6)
    np.testing.assert_allclose(angle[(LONG < 0.99) | (LONG > 3.1)], 0.0, atol=1e-6)


@pytest.mark.parametrize('duration', [0.0, 0.3])
def test_a_load_comes_again_every_period(duration):
    angle = bent(hold_s=0.5, period_s=1.5, duration_s=duration)
    for onset in (1.0, 2.5, 4.0, 5.5, 7.0):
        inside = np.abs(LONG - onset - 0.25) < 0.25 - duration / 2.0 - 0.02
        outside = np.abs(LONG - onset - 1.0) < 0.5 - duration / 2.0 - 0.03
        np.testing.assert_allclose(angle[inside], FULL, atol=1e-3)
        np.testing.assert_allclose(angle[outside], 0.0, atol=1e-3)
    assert np.abs(angle[LONG < 0.8]).max() < 1e-9


def test_a_load_that_is_held_longer_than_its_period_stays():
    angle = bent(hold_s=1.6, period_s=1.5, duration_s=0.2)
    np.testing.assert_allclose(angle[LONG > 1.2], FULL, atol=1e-6)


def test_its_moment_has_no_jump_where_a_pulse_follows_another():
    angle = bent(hold_s=0.9, period_s=1.0, duration_s=0.6)
    assert np.abs(np.diff(angle)).max() < 3.0 * FULL / 600.0

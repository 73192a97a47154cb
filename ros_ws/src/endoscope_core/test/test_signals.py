import numpy as np
import pytest

from endoscope_core.signals import (
    CALIBRATION_RATE,
    CALIBRATION_RECORD_DURATION,
    CALIBRATION_SAMPLES,
    MOTIONS,
    calibration_motion,
    calibration_sinusoid,
    hold,
    motion_by_name,
    move,
    non_periodic_signal,
    periodic_signal,
    sequence,
    sum_of_sines,
)


@pytest.mark.parametrize('name', MOTIONS)
def test_velocity_is_the_slope_of_the_angle(name):
    motion = motion_by_name(name)
    step = 1e-4
    time = np.arange(0.0, motion.duration, 0.0101)
    ahead, _ = motion.sample(np.clip(time + step, 0.0, motion.duration))
    behind, _ = motion.sample(np.clip(time - step, 0.0, motion.duration))
    width = np.clip(time + step, 0.0, motion.duration) - np.clip(time - step, 0.0, motion.duration)
    _, velocity = motion.sample(time)
    np.testing.assert_allclose((ahead - behind) / width[:, None], velocity, atol=5e-3)


@pytest.mark.parametrize('name', MOTIONS)
def test_motion_starts_and_ends_at_rest_at_zero_and_holds_there(name):
    motion = motion_by_name(name)
    for when in (-1.0, 0.0, motion.duration, motion.duration + 1.0):
        angle, velocity = motion.sample(when)
        np.testing.assert_allclose(angle, 0.0, atol=1e-9)
        np.testing.assert_allclose(velocity, 0.0, atol=1e-9)


@pytest.mark.parametrize('name', MOTIONS)
def test_motion_is_one_that_a_rig_can_follow(name):
    motion = motion_by_name(name)
    time = np.arange(0.0, motion.duration, 0.001)
    angle, velocity = motion.sample(time)
    assert np.max(np.abs(angle)) <= np.deg2rad(90.01)
    assert np.max(np.abs(velocity)) < 22.0
    assert np.max(np.abs(np.diff(angle, axis=0))) < 0.022


def test_calibration_is_the_papers_sinusoid_once_begun():
    signal = calibration_sinusoid()
    time = np.linspace(0.5, CALIBRATION_RECORD_DURATION - 1e-9, 500)
    angle, velocity = signal(time)
    np.testing.assert_allclose(angle, np.deg2rad(90.0) * np.sin(time))
    np.testing.assert_allclose(velocity, np.deg2rad(90.0) * np.cos(time), atol=1e-6)
    assert signal.steady[1] - signal.steady[0] == pytest.approx(2.0 * np.pi)
    assert round(CALIBRATION_RATE * CALIBRATION_RECORD_DURATION) == CALIBRATION_SAMPLES
    assert signal.duration < 11.0


def test_brief_calibration_holds_a_whole_loop_and_comes_back():
    motion = calibration_motion('brief')
    time = np.linspace(0.0, motion.signal.duration, 4000)
    angle, velocity = motion.signal(time)
    assert np.max(np.abs(angle)) <= np.deg2rad(90.01)
    assert np.max(np.abs(velocity)) < 7.0
    begin, end = motion.signal.steady
    np.testing.assert_allclose(np.rad2deg(motion.signal([begin, end])[0]), 90.0, atol=0.01)
    assert np.rad2deg(np.min(motion.signal(np.linspace(begin, end, 500))[0])) < -89.9
    assert motion.samples == round(1000 * end)
    assert motion.signal.duration < 4.0
    assert abs(angle[-1]) < 1e-6
    assert abs(velocity[-1]) < 1e-6


def test_papers_signals_have_their_form_while_steady():
    time = np.linspace(*periodic_signal().steady, 300)
    np.testing.assert_allclose(periodic_signal()(time)[0], np.deg2rad(60.0) * np.sin(time))
    time = np.linspace(*non_periodic_signal().steady, 300)
    expected = np.deg2rad(30.0) * (np.sin(time) + np.sin(np.sqrt(3.0) * time))
    np.testing.assert_allclose(non_periodic_signal()(time)[0], expected, atol=1e-12)


@pytest.mark.parametrize('joint', [0, 1])
def test_commissioning_has_wide_strokes_twice_a_hold_and_a_small_loop(joint):
    motion = motion_by_name('commissioning')
    time = np.arange(0.0, motion.duration, 0.01)
    angle = np.rad2deg(motion.sample(time)[0][:, joint])
    held = np.flatnonzero(np.diff(angle) != 0.0)
    assert 0.01 * np.diff(held[held > 0.5 * len(angle)]).max() == pytest.approx(5.0, abs=0.05)
    angle = angle[np.r_[True, np.diff(angle) != 0.0]]
    turned = angle[1:-1][np.diff(np.sign(np.diff(angle))) != 0.0]
    strokes = np.diff(turned)
    assert np.sum(strokes > 135.0) >= 2
    assert np.sum(strokes < -135.0) >= 2
    assert np.any((strokes > 9.0) & (strokes < 15.0) & (np.abs(turned[1:]) < 15.0))


@pytest.mark.parametrize(
    ('make', 'complaint'),
    [
        (lambda: sequence('jumpy', [move(0.0, 1.0, 1.0), hold(1.0)]), 'jumpy: hold begins'),
        (lambda: sum_of_sines('brief', [(1.0, 1.0)], 2.0), 'too short'),
        (lambda: motion_by_name('periodik'), "nearest is 'periodic'"),
    ],
)
def test_what_is_no_motion_is_refused(make, complaint):
    with pytest.raises(ValueError, match=complaint):
        make()

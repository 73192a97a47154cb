import math

import numpy as np
import pytest

from endoscope_core.control import DesiredMotion
from endoscope_core.control.desired_motion import AGREEMENT
from endoscope_core.control.limits import COUNT

TICK = 1e-3


def motion_at(time):
    return math.sin(time), math.cos(time)


def follow(motion, messages, dt=TICK):
    """Angles and velocities (N,) of the first joint."""
    answers = [motion.follow((x, 0.0), () if v is None else (v, 0.0), dt) for x, v in messages]
    return np.array([[angles[0], velocities[0]] for angles, velocities in answers]).T


def test_a_velocity_that_agrees_is_taken():
    time = np.arange(0.0, 3.0, TICK)
    angle, velocity = follow(DesiredMotion(2), [motion_at(t) for t in time])
    np.testing.assert_allclose(velocity[3:], np.cos(time)[3:], atol=1e-9)
    assert np.max(np.abs(angle - np.sin(time))) <= COUNT + 1e-12


def test_without_velocities_it_is_estimated_with_the_stated_lag():
    time = np.arange(0.0, 6.0, TICK)
    _, velocity = follow(DesiredMotion(2), [(math.sin(t), None) for t in time])
    late = np.cos(time - 2.0 / 60.0)
    assert np.max(np.abs(velocity - late)[500:]) < 0.06


@pytest.mark.parametrize('wrong', [0.5, -0.5, 3.0, 0.1])
def test_a_wrong_velocity_now_and_then_is_not_used(wrong):
    time = np.arange(0.0, 4.0, TICK)
    messages = [motion_at(t) for t in time]
    for k in range(100, len(messages), 50):
        messages[k] = (messages[k][0], messages[k][1] + wrong)
    _, velocity = follow(DesiredMotion(2), messages)
    assert np.max(np.abs(velocity - np.cos(time))[3:]) < 0.03


def test_what_is_let_through_moves_what_is_foreseen_by_less_than_the_play_of_the_laws():
    time = np.arange(0.0, 4.0, TICK)
    messages = [motion_at(t) for t in time]
    for k in range(100, len(messages), 50):
        messages[k] = (messages[k][0], messages[k][1] + 0.95 * AGREEMENT)
    angle, velocity = follow(DesiredMotion(2), messages)
    clean, _ = follow(DesiredMotion(2), [motion_at(t) for t in time])
    foreseen = angle + 0.06 * velocity
    assert 0.9 * COUNT < np.max(np.abs(foreseen - clean - 0.06 * np.cos(time))[3:]) <= COUNT


@pytest.mark.parametrize('said', [(5.0, 5.0), (2.0, -2.0)])
def test_velocities_that_never_fit_are_never_used(said):
    time = np.arange(0.0, 3.0, TICK)
    _, estimated = follow(DesiredMotion(2), [(math.sin(t), None) for t in time])
    messages = [(math.sin(t), math.cos(t) + said[k % 2]) for k, t in enumerate(time)]
    _, velocity = follow(DesiredMotion(2), messages)
    np.testing.assert_array_equal(velocity, estimated)


@pytest.mark.parametrize('rate', [50, 250, 1000])
def test_noise_of_one_count_with_the_velocity_of_its_steps_stays_at_rest(rate):
    generator = np.random.default_rng(rate)
    noisy = 0.3 + COUNT * generator.integers(-1, 2, 4 * rate)
    speeds = np.diff(noisy, prepend=noisy[0]) * rate
    angle, velocity = follow(
        DesiredMotion(2), list(zip(noisy.tolist(), speeds.tolist(), strict=True)), 1.0 / rate
    )
    assert np.ptp(angle[rate:]) == 0.0
    assert np.max(np.abs(velocity[2 * rate :])) < 1e-12


def test_a_restart_begins_from_rest():
    motion = DesiredMotion(2)
    follow(motion, [motion_at(t) for t in np.arange(0.0, 1.0, TICK)])
    motion.restart()
    assert motion.follow((-0.4, 0.1), (1.0, 1.0), TICK) == ((-0.4, 0.1), (0.0, 0.0))


@pytest.mark.parametrize(
    'inputs',
    [
        ((math.nan, 0.0), (), TICK),
        ((0.0,), (), TICK),
        ((0.0, 0.0), (1.0,), TICK),
        ((0.0, 0.0), (0.0, math.inf), TICK),
        ((0.0, 0.0), (), 0.0),
        ((0.0, 0.0), (), math.nan),
    ],
)
def test_bad_input_is_refused_and_changes_nothing(inputs):
    motion, other = DesiredMotion(2), DesiredMotion(2)
    follow(motion, [motion_at(t) for t in np.arange(0.0, 0.1, TICK)])
    follow(other, [motion_at(t) for t in np.arange(0.0, 0.1, TICK)])
    with pytest.raises(ValueError, match=r'must be|there are'):
        motion.follow(*inputs)
    assert motion.follow((0.1, 0.0), (), TICK) == other.follow((0.1, 0.0), (), TICK)

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.control import Feedforward, FeedforwardLaw, FeedforwardSettings, MotorLimits
from endoscope_core.hysteresis import BoucWenParameters, direct_inverse
from endoscope_core.rig import shipped_rig

TICK = 1e-3
LIMITS = MotorLimits.of(shipped_rig())
SETTINGS = FeedforwardSettings(LIMITS)
SMALL = BoucWenParameters.from_shape(alpha=0.9, lag=0.3, travel=0.02, rho=-0.9, n=2.0)
LARGE = BoucWenParameters.from_shape(alpha=0.95, lag=0.8, travel=0.04, rho=-0.9, n=3.0)
NONE = FeedforwardLaw()
laws = st.sampled_from(
    [
        NONE,
        FeedforwardLaw('bouc_wen', (SMALL, LARGE)),
        FeedforwardLaw('bouc_wen', (LARGE, SMALL)),
        FeedforwardLaw('none', (SMALL, SMALL)),
    ]
)


def desired_at(time):
    return np.array([math.sin(time), 0.7 * math.sin(1.3 * time)])


def velocity_at(time):
    return np.array([math.cos(time), 0.91 * math.cos(1.3 * time)])


def run(feedforward, start, end):
    return np.array(
        [feedforward.step(desired_at(t), velocity_at(t), TICK) for t in np.arange(start, end, TICK)]
    )


def test_without_lead_it_is_equation_5():
    feedforward = Feedforward(
        1, FeedforwardSettings(LIMITS, lead=0.0, speed_limit=1e3, dead_band=0.0)
    )
    feedforward.select(FeedforwardLaw('bouc_wen', (LARGE,)))
    theta = np.sin(np.arange(0.0, 7.0, TICK))
    commands = [feedforward.step([x], [0.0], TICK)[0] for x in theta]
    np.testing.assert_allclose(commands, direct_inverse(LARGE, theta), atol=1e-12)


@given(laws, laws, st.floats(0.2, 1.2))
def test_a_switch_while_moving_leaves_no_jump(before, after, when):
    feedforward = Feedforward(2, SETTINGS)
    feedforward.select(before)
    last = run(feedforward, 0.0, when)[-1]
    feedforward.select(after)
    next_ = feedforward.step(desired_at(when), velocity_at(when), TICK)
    slope = max(p.inverse_slope for p in (SMALL, LARGE))
    own_motion = slope * 1.2 * TICK
    assert np.all(np.abs(next_ - last) <= own_motion + SETTINGS.offset_rate * TICK)


def test_the_offset_of_a_switch_is_worked_off():
    switched, straight = Feedforward(2, SETTINGS), Feedforward(2, SETTINGS)
    law = FeedforwardLaw('bouc_wen', (SMALL, LARGE))
    straight.select(law)
    run(switched, 0.0, 1.0)
    run(straight, 0.0, 1.0)
    switched.select(law)
    assert np.max(np.abs(switched.offset)) > 0.1
    np.testing.assert_allclose(run(switched, 1.0, 7.0)[-1], run(straight, 1.0, 7.0)[-1], atol=1e-3)


def test_at_rest_a_switch_moves_nothing():
    feedforward = Feedforward(2, SETTINGS)
    feedforward.select(FeedforwardLaw('bouc_wen', (SMALL, LARGE)))
    run(feedforward, 0.0, 1.0)
    rest = desired_at(1.0), (0.0, 0.0), TICK
    before = feedforward.step(*rest)
    for change in (
        lambda: feedforward.select(FeedforwardLaw('bouc_wen', (LARGE, SMALL))),
        lambda: feedforward.select(NONE),
        lambda: feedforward.rebase(before),
    ):
        change()
        commands = np.array([feedforward.step(*rest) for _ in range(3000)])
        assert np.max(np.abs(commands - before)) < 1e-12


def test_it_goes_on_from_a_command_that_someone_else_sent():
    feedforward = Feedforward(2, SETTINGS)
    feedforward.select(FeedforwardLaw('bouc_wen', (SMALL, LARGE)))
    feedforward.rebase([0.4, -0.2])
    first = feedforward.step([0.0, 0.0], [0.0, 0.0], TICK)
    np.testing.assert_allclose(first, [0.4, -0.2], atol=2e-3)
    run(feedforward, 0.0, 1.0)
    feedforward.rebase([-0.5, 0.5])
    np.testing.assert_allclose(
        feedforward.step(desired_at(1.0), velocity_at(1.0), TICK), [-0.5, 0.5], atol=0.05
    )


@given(st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5)), min_size=2, max_size=40))
def test_command_and_its_speed_are_bounded_whatever_is_desired(desired):
    feedforward = Feedforward(2, SETTINGS)
    feedforward.select(FeedforwardLaw('bouc_wen', (SMALL, LARGE)))
    commands = np.array([feedforward.step(angle, [0.0, 0.0], TICK) for angle in desired])
    assert np.all(np.abs(commands) <= (1.5 + 0.8) / 0.9)
    limit = feedforward.settings.speed_limit * TICK
    assert np.all(np.abs(np.diff(commands, axis=0)) <= limit + 1e-12)


@pytest.mark.parametrize(
    'inputs',
    [
        ([math.nan, 0.0], [0.0, 0.0], TICK),
        ([0.0], [0.0, 0.0], TICK),
        ([0.0, 0.0], [0.0, math.inf], TICK),
        ([0.0, 0.0], [0.0, 0.0], 0.0),
        ([0.0, 0.0], [0.0, 0.0], math.nan),
    ],
)
def test_bad_input_is_refused_and_changes_nothing(inputs):
    feedforward = Feedforward(2, SETTINGS)
    feedforward.select(FeedforwardLaw('bouc_wen', (SMALL, LARGE)))
    run(feedforward, 0.0, 0.2)
    before = feedforward.command
    with pytest.raises(ValueError, match='must be'):
        feedforward.step(*inputs)
    np.testing.assert_array_equal(feedforward.command, before)


def test_laws_that_would_guess_are_refused():
    with pytest.raises(ValueError, match='unknown compensation mode'):
        FeedforwardLaw('bouc_when', (SMALL,))
    with pytest.raises(ValueError, match='calibrate first'):
        FeedforwardLaw('bouc_wen')
    feedforward = Feedforward(2, SETTINGS)
    with pytest.raises(ValueError, match='2 wanted'):
        feedforward.select(FeedforwardLaw('bouc_wen', (SMALL,)))
    assert feedforward.law == NONE


@pytest.mark.parametrize('changes', [{'lead': -1.0}, {'offset_rate': 0.0}, {'speed_limit': -1.0}])
def test_settings_out_of_range_are_refused(changes):
    with pytest.raises(ValueError, match=next(iter(changes))):
        FeedforwardSettings(LIMITS, **changes)

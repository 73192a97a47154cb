import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.safety import MotionLimits, MotionShaper

TICK = 1e-3
LIMITS = MotionLimits((-1.5, -1.0), (1.5, 1.0), speed=5.0, acceleration=100.0, step=0.1)
ROUNDING = 1e-9

anywhere = st.floats(-1e6, 1e6)
near = st.floats(-2.0, 2.0)
periods = st.floats(1e-6, 0.05)
start = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.0, 1.0))
calls = st.lists(
    st.one_of(
        st.tuples(st.just('shape'), st.tuples(anywhere, near), periods),
        st.tuples(st.just('shape'), st.tuples(near, near), st.floats(1e-3, 2e-3)),
        st.tuples(st.just('restart'), start, st.none()),
    ),
    max_size=80,
)


def shaper_at(position=(0.0, 0.0)):
    shaper = MotionShaper(LIMITS)
    shaper.restart(position)
    return shaper


def run(shaper, targets, period=TICK):
    return np.array([shaper.shape(target, period) for target in targets])


@given(start, calls)
def test_no_sequence_of_calls_leads_beyond_a_bound(begin, sequence):
    shaper = shaper_at(begin)
    position, velocity = begin, (0.0, 0.0)
    for call, value, period in sequence:
        if call == 'restart':
            shaper.restart(value)
            position, velocity = value, (0.0, 0.0)
            continue
        after = shaper.shape(value, period)
        if period > LIMITS.longest_period:
            period, velocity = LIMITS.longest_period, (0.0, 0.0)
        for j in range(2):
            moved = after[j] - position[j]
            rounding = ROUNDING / period
            assert LIMITS.low[j] <= after[j] <= LIMITS.high[j]
            assert abs(moved) <= LIMITS.step + ROUNDING
            assert abs(moved) / period <= LIMITS.speed + rounding
            change = abs(moved / period - velocity[j])
            assert change <= LIMITS.acceleration * period + rounding
            assert shaper.velocity[j] == pytest.approx(moved / period, abs=rounding)
        position, velocity = after, shaper.velocity


# Short of the end of the range, where a last period would have to brake; and slow enough for a
# period of 1 ms to hold the change of speed of the 3 ms from the middle of one of 5 ms to its own.
@given(
    st.floats(0.05, 0.74),
    st.floats(0.2, 7.0),
    st.lists(st.sampled_from([1e-3, 2e-3, 5e-3]), min_size=1, max_size=5),
)
def test_a_motion_within_the_bounds_passes_unchanged_and_undelayed(amplitude, omega, strides):
    amplitude = min(amplitude, 4.0 / omega, 30.0 / omega**2)
    shaper = shaper_at()
    time, missed = 0.0, []
    for k in range(300):
        dt = strides[k % len(strides)]
        time += dt
        target = amplitude * (1.0 - math.cos(omega * time))
        position = shaper.shape((target, 0.1), dt)
        missed.append((abs(target - position[0]), abs(0.1 - position[1])))
    assert np.max(np.array(missed)[:, 0]) < 1e-12
    # The second joint had to be caught up with first.
    assert np.max(np.array(missed)[150:, 1]) < 1e-12


@given(
    st.lists(st.tuples(st.tuples(anywhere, near), st.integers(5, 300)), min_size=1, max_size=4),
    st.sampled_from([1e-3, 2e-3, 5e-3]),
)
def test_a_motion_that_was_put_at_the_bounds_passes_them_again(steps, period):
    first, second = shaper_at(), shaper_at()
    for target, count in steps:
        bounded = run(first, [target] * count, period)
        np.testing.assert_allclose(run(second, bounded, period), bounded, atol=1e-11)
    assert second.bounded == 0


def test_a_step_becomes_the_trapezoid_of_the_bounds_without_overshoot():
    positions = run(shaper_at((-0.7, 0.0)), [(0.7, 0.0)] * 1000)[:, 0]
    assert np.all(np.diff(positions) >= 0.0)
    assert np.max(positions) <= 0.7
    # 1.4 rad with 5 rad/s and 100 rad/s^2: 1.4 / 5 + 5 / 100 s.
    arrived = np.argmax(positions > 0.7 - 1e-6)
    assert arrived * TICK == pytest.approx(1.4 / 5.0 + 5.0 / 100.0, abs=5 * TICK)
    assert positions[-1] == pytest.approx(0.7, abs=1e-12)


def test_a_motion_too_fast_for_the_bounds_is_caught_up_with():
    time = np.arange(0.0, 2.0, TICK)
    ramp = np.clip(20.0 * (time - 0.2), -1.0, 1.0) + 0.2 * np.sin(3.0 * time)
    positions = run(shaper_at((-1.0, 0.0)), [(x, 0.0) for x in ramp])[:, 0]
    assert np.max(np.abs(positions - ramp)) > 0.3
    assert np.max(np.abs(positions - ramp)[1000:]) < 1e-12
    assert np.max(positions) < 1.25


def test_a_start_beyond_the_range_leads_only_back():
    shaper = shaper_at((1.7, 0.0))
    assert shaper.shape((3.0, 0.0), TICK)[0] == 1.7
    positions = run(shaper, [(1.6, 0.0)] * 2000)[:, 0]
    assert np.all(np.diff(positions) <= 0.0)
    assert positions[-1] == pytest.approx(1.5, abs=0.1 + 1e-9)


def test_what_was_bounded_is_counted():
    shaper = shaper_at()
    run(shaper, [(1e-5, 0.0), (2e-5, 0.0)])
    assert shaper.bounded == 0
    shaper.shape((1.0, 0.0), TICK)
    assert shaper.bounded == 1


@pytest.mark.parametrize(
    ('target', 'period'),
    [
        ((math.nan, 0.0), TICK),
        ((0.0, math.inf), TICK),
        ((0.0,), TICK),
        ((0.0, 0.0), 0.0),
        ((0.0, 0.0), math.nan),
    ],
)
def test_what_is_no_target_or_period_is_refused_and_changes_nothing(target, period):
    shaper = shaper_at()
    run(shaper, [(1.0, 0.0)] * 50)
    before = shaper.position, shaper.velocity
    with pytest.raises(ValueError, match='must be'):
        shaper.shape(target, period)
    assert (shaper.position, shaper.velocity) == before


def test_without_a_start_nothing_moves():
    with pytest.raises(RuntimeError, match='restart'):
        MotionShaper(LIMITS).shape((0.0, 0.0), TICK)


@pytest.mark.parametrize('changes', [{'speed': 0.0}, {'step': math.nan}, {'high': (-2.0, 1.0)}])
def test_limits_that_are_none_are_refused(changes):
    values = {
        'low': (-1.0, -1.0),
        'high': (1.0, 1.0),
        'speed': 1.0,
        'acceleration': 1.0,
        'step': 0.1,
    }
    with pytest.raises(ValueError, match=r'must be|empty'):
        MotionLimits(**(values | changes))

import math

import numpy as np
import pytest
from driven_play import PERIOD, TICK, DrivenPlay
from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.control import (
    AdaptiveBacklashController,
    AdaptiveBacklashSettings,
    TrackerMeasurement,
)
from endoscope_core.control.adaptive_backlash import (
    AdaptationState,
    adapt,
    learnt_term,
    robust_term,
)


@pytest.mark.parametrize('half_gap', [0.1, 0.7])
def test_it_learns_a_backlash_of_unknown_size_once_it_is_activated(half_gap):
    alone, nothing = DrivenPlay(half_gap, 20, active=False).run(20.0, math.sin)
    assert not nothing.any()
    helped, _ = DrivenPlay(half_gap, 20).run(20.0, math.sin)
    late = slice(13000, None)
    assert np.std(helped[late]) < 0.25 * np.std(alone[late])


def test_late_measurements_are_compared_with_what_was_desired_then():
    controller = AdaptiveBacklashController(1)
    controller.activate()
    for k in range(3000):
        angle = math.sin(k * TICK)
        stamp = (k - 100) * TICK
        measurement = (
            TrackerMeasurement(stamp, [math.sin(stamp)]) if k % PERIOD == 0 and k > 200 else None
        )
        controller.step(k * TICK, [angle], [math.cos(k * TICK)], measurement)
    assert controller.learnt[0] == pytest.approx((0.0, 0.0), abs=1e-6)


@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0)), min_size=1, max_size=60))
def test_the_correction_is_bounded_whatever_the_tracker_says(samples):
    settings_ = AdaptiveBacklashSettings()
    controller = AdaptiveBacklashController(1, settings_)
    controller.activate()
    for k, (angle, measured) in enumerate(samples):
        time = 0.025 * (k + 1)
        correction = controller.step(time, [angle], [0.0], TrackerMeasurement(time, [measured]))
        assert abs(correction[0]) <= settings_.output_limit
    gain, backlash = controller.learnt[0]
    assert abs(gain) <= settings_.gain_limit
    assert abs(backlash) <= settings_.backlash_limit


@pytest.mark.parametrize(
    'measurement',
    [
        TrackerMeasurement(0.5, [math.nan]),
        TrackerMeasurement(0.5, [0.0, 0.0]),
        TrackerMeasurement(0.3, [0.0]),
        TrackerMeasurement(9.0, [0.0]),
        TrackerMeasurement(math.nan, [0.0]),
    ],
)
def test_an_unusable_measurement_is_counted_and_ignored(measurement):
    controller = AdaptiveBacklashController(1)
    controller.activate()
    controller.step(0.4, [0.1], [0.0], TrackerMeasurement(0.4, [0.2]))
    before = controller.learnt
    controller.step(0.6, [0.1], [0.0], measurement)
    assert controller.refused == 1
    assert controller.learnt == before


@pytest.mark.parametrize(
    'inputs',
    [(0.1, [0.0], [0.0]), (math.nan, [0.0], [0.0]), (0.3, [math.inf], [0.0]), (0.3, [0.0], [])],
)
def test_bad_input_is_refused(inputs):
    controller = AdaptiveBacklashController(1)
    controller.step(0.2, [0.0], [0.0])
    with pytest.raises(ValueError, match='must'):
        controller.step(*inputs)
    controller.step(0.21, [0.0], [0.0])


def test_settings_that_close_an_algebraic_loop_are_refused():
    with pytest.raises(ValueError, match='loop_gain'):
        AdaptiveBacklashSettings(loop_gain=1.0)
    with pytest.raises(ValueError, match='boundary_layer'):
        AdaptiveBacklashSettings(boundary_layer=0.0)


@given(
    st.floats(0.5, 1.5),
    st.floats(-0.3, 0.3),
    st.floats(-0.5, 0.5),
    st.floats(0.0, 0.03),
    st.integers(0, 2**31),
)
def test_the_lyapunov_function_does_not_rise(gain, true_gain, true_backlash, rest, seed):
    """The argument of the docstring, on the map that it is made for, to first order in dt."""
    c = AdaptiveBacklashSettings(
        leakage=0.0,
        bound_leakage=0.0,
        error_limit=10.0,
        integral_limit=10.0,
        gain_limit=10.0,
        backlash_limit=10.0,
    )
    generator = np.random.default_rng(seed)
    dt = 1e-5
    state = AdaptationState(
        gain=generator.uniform(-0.3, 0.3),
        backlash=generator.uniform(-0.5, 0.5),
        bound=generator.uniform(0.0, 0.9) * c.loop_gain * c.boundary_layer,
        integral=generator.uniform(-0.02, 0.02),
    )

    def value(s):
        squares = (
            (s.gain - true_gain) ** 2 / c.gain_rate
            + (s.backlash - true_backlash) ** 2 / c.backlash_rate
            + (s.bound - rest) ** 2 / c.bound_rate
        )
        return 0.5 * gain * squares + 0.5 * s.integral**2 / c.integral_weight

    for _ in range(20):
        theta, s = generator.uniform(-1.5, 1.5), generator.uniform(-1.0, 1.0)
        eta = gain * rest * generator.uniform(-1.0, 1.0)
        mismatch = (state.gain - true_gain) * theta + (state.backlash - true_backlash) * s
        error = gain * mismatch + eta
        for _ in range(60):  # the algebraic loop through tanh, a contraction for loop_gain < 1
            surface = error + state.integral
            now = AdaptationState(bound=state.bound, surface=surface)
            error = gain * (mismatch + robust_term(c, now)) + eta
        assert learnt_term(state, theta, s) - true_gain * theta - true_backlash * s == (
            pytest.approx(mismatch)
        )
        after = adapt(c, state, error, theta, s, dt)
        allowed = 0.2785 * c.boundary_layer * gain * state.bound - error**2
        assert value(after) - value(state) <= dt * allowed + 1e-7 * dt + 50.0 * dt**2
        state = after

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from endoscope_core.hysteresis import BoucWenParameters, direct_inverse, forward
from endoscope_core.hysteresis.memory_model import GREATEST_INVERSE_SLOPE

SAFE = BoucWenParameters.from_shape(alpha=0.92, lag=0.6, travel=0.4, rho=0.4, n=2.2)

shapes = st.tuples(
    st.floats(0.3, 2.0),
    st.floats(0.01, 1.5),
    st.floats(0.3, 1.5),
    st.floats(-0.95, 1.0),
    st.one_of(st.just(1.0), st.floats(1.0, 5.0)),
)
parameter_sets = shapes.map(lambda shape: BoucWenParameters.from_shape(*shape))
moves = st.floats(-1e6, 1e6) | st.floats(-1.0, 1.0) | st.floats(-1e-9, 1e-9)


@given(parameter_sets, st.floats(-1.0, 1.0), st.lists(moves, min_size=1, max_size=30))
def test_state_moves_with_its_driver_and_stays_within_its_bound(parameters, start, steps):
    y = start
    for step in steps:
        before, y = y, parameters.memory_step(y, step)
        assert abs(y) <= 1.0 + 1e-12
        assert (y - before) * step >= -1e-15


@pytest.mark.parametrize('n', [1.0, 1.3, 2.0, 3.7])
@pytest.mark.parametrize('rho', [-0.9, 0.0, 0.8, 1.0])
def test_solution_is_that_of_equation_4(n, rho):
    p = BoucWenParameters.from_shape(0.9, 0.5, 0.4, rho, n)

    def equation_4(t, h):
        speed = 1.4 * math.cos(t)
        return (
            p.A * speed
            - p.B * abs(speed) * np.abs(h) ** (p.n - 1.0) * h
            - p.C * speed * np.abs(h) ** p.n
        )

    time = np.arange(0.0, 8.0, 1e-3)
    reference = solve_ivp(equation_4, (0.0, 8.0), [0.0], t_eval=time, rtol=1e-9, atol=1e-11).y[0]
    theta = 1.4 * np.sin(time)
    state = (forward(p, theta) - p.alpha * theta) / p.beta
    np.testing.assert_allclose(state, reference, atol=5e-6)


@given(parameter_sets, st.lists(st.floats(-2.0, 2.0), min_size=2, max_size=40))
def test_inverse_is_bounded_in_gain_and_slope(parameters, knots):
    theta = np.interp(np.linspace(0.0, 1.0, 2000), np.linspace(0.0, 1.0, len(knots)), knots)
    command = direct_inverse(parameters, theta)
    bound = (np.abs(theta) + parameters.lag) / parameters.alpha
    assert np.all(np.abs(command) <= bound + 1e-9)
    rise = np.abs(np.diff(command))
    assert np.all(rise <= parameters.inverse_slope * np.abs(np.diff(theta)) + 1e-9)
    assert np.all(np.diff(command) * np.diff(theta) >= -1e-12)


def test_saturated_loop_is_as_wide_as_the_lag_says():
    theta = 3.0 * np.sin(np.arange(0.0, 4.0 * np.pi, 1e-3))
    lagging = forward(SAFE, theta) - SAFE.alpha * theta
    assert np.max(lagging) == pytest.approx(SAFE.lag, rel=1e-3)
    assert np.min(lagging) == pytest.approx(-SAFE.lag, rel=1e-3)


@pytest.mark.parametrize(
    ('changes', 'complaint'),
    [
        ({'alpha': 0.0}, 'alpha'),
        ({'alpha': -1.0}, 'alpha'),
        ({'beta': 0.1}, 'beta'),
        ({'A': 0.0}, 'A = 0'),
        ({'B': 0.0}, 'B = 0'),
        ({'C': -1e9}, r'B \+ C'),
        ({'n': 0.5}, 'n = 0.5'),
        ({'n': math.nan}, 'n is nan'),
        ({'beta': -6.0}, '120 deg'),
        ({'beta': -60.0, 'B': 1e4}, 'too steep'),
    ],
)
def test_unsafe_parameters_are_refused(changes, complaint):
    with pytest.raises(ValueError, match=complaint):
        BoucWenParameters(**{**SAFE.to_dict(), **changes})


def test_slope_limit_is_what_the_inverse_reaches():
    steep = BoucWenParameters.from_shape(
        1.0, 0.5, 0.5 / (0.999 * GREATEST_INVERSE_SLOPE - 1.0), -0.9, 2.0
    )
    theta = np.concatenate([np.linspace(0.0, 1.0, 20001), np.linspace(1.0, 0.0, 20001)])
    slope = np.diff(direct_inverse(steep, theta)) / np.where(np.diff(theta) == 0, 1, np.diff(theta))
    assert np.max(slope) == pytest.approx(steep.inverse_slope, rel=0.01)


@pytest.mark.parametrize('series', [[], [[0.0]], [0.0, math.nan]])
def test_what_is_no_series_is_refused(series):
    with pytest.raises(ValueError, match='non-empty series'):
        direct_inverse(SAFE, series)

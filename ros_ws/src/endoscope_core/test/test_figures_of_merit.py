import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from play_loop import play

from endoscope_core.metrics import tracking_rmse, width_at_mid_height

TIME = np.arange(0.0, 4.0 * np.pi, 0.002)
SETTLED = 2.0 * np.pi <= TIME


@given(st.floats(0.01, 0.6), st.floats(1.0, 2.0))
def test_width_of_a_play_is_its_gap(half_gap, amplitude):
    desired = amplitude * np.sin(TIME)
    actual = play(desired, half_gap)
    width = width_at_mid_height(desired[SETTLED], actual[SETTLED])
    assert width == pytest.approx(2.0 * half_gap, abs=2e-5)


def test_width_stands_noise_that_crosses_the_middle_many_times():
    desired = 1.5 * np.sin(TIME)
    noise = np.random.default_rng(3).normal(0.0, 0.005, TIME.size)
    actual = play(desired, 0.4) + noise
    assert width_at_mid_height(desired[SETTLED], actual[SETTLED]) == pytest.approx(0.8, abs=0.01)


@pytest.mark.parametrize(
    ('desired', 'actual', 'complaint'),
    [
        ([0.0, 1.0], [0.0, 1.0, 2.0], 'equally long'),
        ([0.0, 1.0, 2.0], [0.0, np.nan, 2.0], 'not finite'),
        ([0.0, 1.0, 2.0], [1.0, 1.0, 1.0], 'does not move'),
        ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], 'no whole loop'),
    ],
)
def test_what_is_no_loop_is_refused(desired, actual, complaint):
    with pytest.raises(ValueError, match=complaint):
        width_at_mid_height(desired, actual)


def test_rmse():
    assert tracking_rmse([0.0, 0.0], [3.0, -4.0]) == pytest.approx(np.sqrt(12.5))


@pytest.mark.parametrize(
    ('desired', 'actual', 'complaint'),
    [([0.0], [0.0, 1.0], 'must be equal'), ([], [], 'no samples'), ([0.0], [np.inf], 'not finite')],
)
def test_rmse_refuses(desired, actual, complaint):
    with pytest.raises(ValueError, match=complaint):
        tracking_rmse(desired, actual)

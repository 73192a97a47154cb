import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from play_loop import play

from endoscope_core.metrics import width_at_mid_height
from endoscope_core.metrics.loop_boundary import backlash_size_by_boundary, loop_boundary

TIME = np.arange(0.0, 4.0 * np.pi, 0.005)
SETTLED = 2.0 * np.pi <= TIME


@given(st.floats(0.1, 0.6), st.floats(1.0, 2.0))
@settings(max_examples=10, deadline=None)
def test_boundary_of_a_play_has_the_width_and_area_of_its_gap(half_gap, amplitude):
    desired = amplitude * np.sin(TIME)
    actual = play(desired, half_gap)
    found = loop_boundary(desired[SETTLED], actual[SETTLED])
    height = 2.0 * (amplitude - half_gap)
    assert found.height == pytest.approx(height, rel=1e-3)
    assert found.width_at_middle == pytest.approx(2.0 * half_gap, rel=0.02)
    assert found.area == pytest.approx(2.0 * half_gap * height, rel=0.02)
    assert found.mean_width == pytest.approx(2.0 * half_gap, rel=0.02)


def test_boundary_of_an_ellipse_has_its_area_and_its_width():
    phase = np.linspace(0.0, 2.0 * np.pi, 1500, endpoint=False)
    desired, actual = 90.0 * np.sin(phase), 70.0 * np.sin(phase - 0.5)
    found = loop_boundary(desired, actual)
    assert found.area == pytest.approx(np.pi * 90.0 * 70.0 * np.sin(0.5), rel=0.01)
    width = width_at_mid_height(desired, actual)
    assert backlash_size_by_boundary(desired, actual) == pytest.approx(width, rel=0.01)


def test_shrinking_hugs_a_hollow_that_the_convex_hull_bridges():
    grid = np.stack(np.meshgrid(np.linspace(0, 3, 61), np.linspace(0, 3, 61)), -1).reshape(-1, 2)
    shape = grid[(grid[:, 0] <= 1.0) | (grid[:, 1] <= 1.0)]
    hull = loop_boundary(shape[:, 0], shape[:, 1], shrink=0.0)
    tight = loop_boundary(shape[:, 0], shape[:, 1], shrink=1.0)
    assert hull.area == pytest.approx(7.0, rel=1e-6)
    assert tight.area == pytest.approx(5.0, rel=0.01)


def test_noise_widens_the_boundary_by_little_more_than_its_reach():
    desired = np.rad2deg(1.5 * np.sin(TIME[SETTLED]))
    actual = np.rad2deg(play(1.5 * np.sin(TIME), 0.4))[SETTLED]
    noisy = actual + np.random.default_rng(1).normal(0.0, 0.25, actual.size)
    clean = backlash_size_by_boundary(desired, actual)
    assert clean - 0.5 < backlash_size_by_boundary(desired, noisy) < clean + 3.0


@pytest.mark.parametrize(
    ('desired', 'actual', 'complaint'),
    [
        ([0.0, 1.0], [0.0], 'equally long'),
        ([0.0, 1.0, np.nan], [0.0, 1.0, 2.0], 'not finite'),
        ([0.0, 1.0, 2.0], [1.0, 1.0, 1.0], 'no area'),
        ([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], 'no area'),
    ],
)
def test_what_encloses_nothing_is_refused(desired, actual, complaint):
    with pytest.raises(ValueError, match=complaint):
        loop_boundary(desired, actual)


def test_shrink_factors_out_of_range_are_refused():
    with pytest.raises(ValueError, match='shrink'):
        loop_boundary([0.0, 1.0, 0.0], [0.0, 0.0, 1.0], shrink=2.0)

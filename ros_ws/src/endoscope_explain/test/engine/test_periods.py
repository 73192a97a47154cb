"""Functions that repeat themselves: their periods, and what they can be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lombscargle

from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import NODES
from endoscope_explain.fit.family import family_at
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.periods import likely_periods, period_bounds, periodogram


@pytest.fixture
def observation(one_joint):
    plant = one_joint.rig()
    (found,) = observe(one_joint.record(plant, one_joint.motion(20.0)), plant)
    return found


def _left(observation, law):
    """Residuals (size,) that are a law of time in one of the channels and noise in all."""
    generator = np.random.default_rng(3)
    residuals = generator.normal(size=observation.size)
    part = observation.slices()[-1]
    residuals[part] += law(observation.channels[-1].time)
    return residuals


def test_the_period_of_what_is_left_is_found_in_time_and_in_a_state(observation):
    time = np.linspace(0.0, observation.duration, observation.inputs.shape[1])
    left = _left(observation, lambda t: np.sign(np.sin(2.0 * np.pi * t / 1.7)))
    assert likely_periods(observation, left, time)[0] == pytest.approx(1.7, rel=0.02)
    state = 0.7 * np.sin(2.0 * np.pi * time / 9.0)
    cogs = _left(observation, lambda t: np.cos(2.0 * np.pi * np.interp(t, time, state) / 0.2))
    assert likely_periods(observation, cogs, state)[0] == pytest.approx(0.2, rel=0.02)


def test_a_state_that_stands_still_or_hardly_moves_has_no_period(observation):
    ticks = observation.inputs.shape[1]
    left = _left(observation, np.zeros_like)
    assert likely_periods(observation, left, np.zeros(ticks)) == []
    shortest, longest = period_bounds(observation, np.linspace(0.0, 1.0, ticks))
    assert 0.0 < shortest < longest == pytest.approx(0.5)


def test_a_period_ends_where_it_began_and_is_as_large_in_every_phase():
    family = family_at(FUNCTIONS['load_periodic'], (0.0, 1.7), band=(0.1, 5.0))
    assert family.basis[0] == pytest.approx(family.basis[-1])
    assert family.basis[: NODES - 1].mean(axis=0) == pytest.approx(0.0, abs=1e-12)
    size = np.sum(family.basis**2, axis=1)
    assert size == pytest.approx(np.full(NODES, size[0]))
    finer = family.finer(20)
    assert finer.basis.shape == (NODES, 20)
    assert np.mean(np.sum(finer.basis**2, axis=1)) == pytest.approx(np.mean(size))
    assert replace(family, high=2.0).nodes[-1] == 2.0


def test_the_periodogram_is_lomb_and_scargles():
    generator = np.random.default_rng(5)
    state = 0.7 * np.sin(np.linspace(0.0, 30.0, 2000)) + 0.05 * generator.normal(size=2000)
    left = np.cos(2.0 * np.pi * state / 0.05) + generator.normal(size=2000)
    left -= left.mean()
    frequencies, shares = periodogram(state, left, 0.01, 0.7)
    direct = lombscargle(state, left, 2.0 * np.pi * frequencies, normalize=True)
    assert frequencies[np.argmax(shares)] == pytest.approx(20.0, rel=0.01)
    assert shares == pytest.approx(direct, abs=0.02)

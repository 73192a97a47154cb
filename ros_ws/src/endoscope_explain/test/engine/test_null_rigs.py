"""Rigs in which nothing is missing."""

import numpy as np
import pytest

from endoscope_explain.observe.observation import observe
from endoscope_explain.search.null_rigs import SLOWEST, Null, wandering


def test_sensors_wander_by_as_much_as_their_noise_and_no_slower_than_a_drift(one_joint):
    plant = one_joint.rig()
    (observation,) = observe(one_joint.record(plant, one_joint.motion(6.0)), plant)
    drawn = wandering(observation, 200, np.random.default_rng(1))
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        if channel.quantity == 'shaft_position':
            assert not np.any(drawn[part]), "an encoder's rounding does not wander"
            continue
        assert np.mean(drawn[part] ** 2) == pytest.approx(1.0, abs=0.1)
        quarter = len(drawn[part]) // 4
        far_apart = np.mean(drawn[part][:-quarter] * drawn[part][quarter:])
        assert abs(far_apart) < np.exp(-0.25 / SLOWEST) + 0.1
        steps = np.mean(np.diff(drawn[part], axis=0) ** 2, axis=0)
        assert steps.min() < 0.2 < 1.0 < steps.max(), 'some are slow and some are white'


def test_one_rig_of_forty_that_shows_as_much_is_the_least_chance():
    null = Null(np.arange(39.0), np.zeros(39))
    assert null.p_value(100.0) == pytest.approx(1.0 / 40.0)
    assert null.p_value(38.0) == pytest.approx(2.0 / 40.0)
    assert null.p_value(-1.0) == 1.0

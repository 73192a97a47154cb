"""Rigs in which nothing is missing."""

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.null_rigs import AT_ONCE, SLOWEST, Null, null_rigs, wandering
from endoscope_explain.search.screen import background, directions
from endoscope_explain.search.term import effects


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


def test_rigs_are_fitted_until_it_is_clear_whether_they_show_as_much(one_joint):
    plant = one_joint.rig()
    true = one_joint.rig(EffectSpec('gravity', 'bend_x', {'moment_nm': 0.003, 'phase_rad': 0.5}))
    (observation,) = observe(one_joint.record(true, one_joint.motion(6.0)), plant)
    nominal, _ = nominal_references(observation, *packed_joint(plant, 'bend_x'))
    behind = background(nominal)
    ways = directions(behind, effects(nominal), 1)
    rigs = null_rigs(behind, ways, nominal, 1)
    screened = rigs.as_screened().drawn

    def fitted(null):
        return np.count_nonzero(null.drawn != screened)

    far = rigs.beside(5.0 * screened.max(), 0.025, 1)
    assert fitted(far) == 0
    assert far.p_value(5.0 * screened.max()) == pytest.approx(1.0 / 40.0)
    clear = rigs.beside(3.5 * screened.max(), 0.025, 1)
    assert 0 < fitted(clear) <= AT_ONCE
    refused = rigs.beside(0.0, 0.025, 1)
    assert 0 < fitted(refused) <= AT_ONCE
    assert refused.p_value(0.0) > 0.025
    doubtful = rigs.beside(1.5 * clear.drawn.max(), 0.025, 1)
    assert fitted(doubtful) > AT_ONCE

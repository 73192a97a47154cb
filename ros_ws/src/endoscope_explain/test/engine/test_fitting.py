"""Derivatives, onsets, and what rigs of another form leave."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.fit.evidence import BLOCK, is_noise, log_evidence, weights
from endoscope_explain.fit.intervals import intervals, may_be_absent, nominal_estimates, other_forms
from endoscope_explain.fit.model import fit, jacobian, packed_joint
from endoscope_explain.fit.nominal import beside, nominal_references
from endoscope_explain.fit.solver import Ended
from endoscope_explain.fit.valleys import out_of_valleys
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.term import with_effect

LOAD = CATALOGUE['external_load']


def references(one_joint, *effects, band=0.15):
    """Nominal plant, refitted and as described, of a rig that has effects."""
    plant = one_joint.rig()
    true = one_joint.rig(*(EffectSpec(name, 'bend_x', values) for name, values in effects))
    (observation,) = observe(one_joint.record(true, one_joint.motion()), plant)
    return nominal_references(observation, *packed_joint(plant, 'bend_x'), band)


def test_beside_another_joint_a_fit_is_another_one_and_the_old_one_stays(one_joint):
    coupled = EffectSpec('cross_coupling', 'bend_x', {'moment_per_rad': 0.0015})
    for effects, moved in (((), False), ((coupled,), True)):
        plant = one_joint.rig(*effects)
        (observation,) = observe(one_joint.record(plant, one_joint.motion()), plant)
        pair = nominal_references(observation, *packed_joint(plant, 'bend_x'))
        before = pair[0].model.residuals(pair[0].theta)
        seen, described = beside(pair, pair[0])
        np.testing.assert_array_equal(pair[0].model.residuals(pair[0].theta), before)
        np.testing.assert_array_equal(seen.model.residuals(seen.theta), seen.residuals)
        assert np.array_equal(seen.residuals, before) is not moved
        assert np.array_equal(seen.jacobian, pair[0].jacobian) is not moved
        assert np.array_equal(described.residuals, pair[1].residuals) is not moved


def test_a_fit_tells_whether_it_converged_and_what_lies_at_a_bound(one_joint):
    refitted, described = references(one_joint)
    assert described.ended is None
    assert refitted.ended in (Ended.CONVERGED, Ended.NO_STEP)
    assert refitted.at_bounds() == ()
    cut_short = fit(described.model, described.theta, iterations=1)
    assert (cut_short.ended, cut_short.steps) == (Ended.SPENT, 1)
    low, _ = described.model.bounds()
    theta = refitted.theta.copy()
    theta[1] = low[1]
    assert replace(refitted, theta=theta).at_bounds() == (refitted.model.free[1].name,)


def evenly(found):
    """Weights that leave the residuals as they are."""
    return np.ones(len(found.residuals))


def test_a_load_that_was_dated_seconds_late_is_dated_again(one_joint):
    refitted, _ = references(one_joint, ('external_load', {'moment_nm': 0.0008, 'time_s': 3.2}))
    model = with_effect(refitted.model, LOAD, {'moment_nm': 0.0006, 'time_s': 8.0})
    late = fit(model, model.begun_at(refitted.theta), iterations=0)
    again = out_of_valleys(late, evenly(late))
    dated, _ = again.model.packed(again.theta)
    assert dated[LOAD.first_parameter + 1] == pytest.approx(3.2, abs=0.05)
    assert dated[LOAD.first_parameter] == pytest.approx(0.0008, rel=0.03)


def test_a_load_after_the_end_has_no_other_date(one_joint):
    refitted, _ = references(one_joint, ('gravity', {'moment_nm': 0.0006, 'phase_rad': 0.0}))
    model = with_effect(refitted.model, LOAD, {'moment_nm': 0.0, 'time_s': 60.0})
    never = fit(model, model.begun_at(refitted.theta), iterations=0)
    again = out_of_valleys(never, evenly(never))
    assert again.model.packed(again.theta)[0][LOAD.first_parameter + 1] == pytest.approx(60.0)


def test_a_number_that_may_hardly_move_has_a_derivative_over_a_wide_step(one_joint):
    refitted, _ = references(one_joint, ('stribeck_friction', {'rise': 0.5}), band=0.03)
    narrow = refitted.model
    start = {'rise': 0.5, 'stribeck_speed': 2e-3}
    model = with_effect(narrow, CATALOGUE['stribeck_friction'], start)
    low, high = model.bounds()
    theta = np.clip(model.begun_at(low[: len(narrow.free)]), low, high)
    derivative = jacobian(model, theta)
    assert (high - low)[0] < model.step
    assert np.all(np.isfinite(derivative))
    assert np.any(derivative[:, 0] != 0.0)


def test_differences_on_coarse_ticks_are_those_on_fine_ones(one_joint):
    refitted, _ = references(one_joint)
    model, theta = refitted.model, refitted.theta
    coarse = jacobian(model, theta)
    for k in range(len(theta)):
        moved = theta.copy()
        moved[k] += 1e-3
        fine = (model.residuals(moved) - model.residuals(theta)) / 1e-3
        if np.linalg.norm(fine) > 1.0:
            assert np.linalg.norm(coarse[:, k] - fine) < 0.15 * np.linalg.norm(fine)


def test_an_effect_that_is_there_has_more_evidence_and_one_that_is_not_has_less(one_joint):
    for concealed, more in ((('joint_backlash', {'gap_rad': 0.06}),), True), ((), False):
        refitted, _ = references(one_joint, *concealed)
        model = with_effect(refitted.model, CATALOGUE['joint_backlash'], {'gap_rad': 0.02})
        found = fit(model, model.begun_at(refitted.theta), iterations=20)
        assert (log_evidence(found) > log_evidence(refitted)) is more
        assert may_be_absent(found, CATALOGUE['joint_backlash']) is not more


def test_strengths_that_stand_for_one_another_are_not_all_nothing(one_joint):
    effect = CATALOGUE['tracker_distortion']
    refitted, _ = references(one_joint, (effect.id, {'linear': -0.3}))
    model = with_effect(refitted.model, effect, {'cubic': -0.1})
    found = fit(model, model.begun_at(refitted.theta), iterations=20)
    # As far as the recording tells, each of them is off by as much as it is large; not their sum.
    strengths = [k for k, item in enumerate(model.free) if item.name in ('linear', 'cubic')]
    form = np.zeros((len(found.theta), len(found.theta)))
    apart = np.array([1.0, -1.0]) * np.abs(found.theta[strengths]).max()
    form[np.ix_(strengths, strengths)] = np.outer(apart, apart)
    unsure = replace(found, moved_by_form=form)
    told = {each.name: each for each in intervals(unsure)}
    for name in ('linear', 'cubic'):
        assert told[name].low < 0.0 < told[name].high
    assert not may_be_absent(unsure, effect)


def test_what_lasts_in_the_noise_scatters_as_few_readings_do(one_joint):
    refitted, _ = references(one_joint)
    observation = refitted.model.observation
    rng = np.random.default_rng(3)

    def with_noise(lasting, told):
        channels, residuals = [], np.empty_like(refitted.residuals)
        for channel, part in zip(observation.channels, observation.slices(), strict=True):
            count = part.stop - part.start
            steady = np.repeat(rng.normal(size=count // BLOCK + 1), BLOCK)[:count]
            white = np.sqrt(1.0 - lasting) * rng.normal(size=count)
            residuals[part] = white + np.sqrt(lasting) * steady
            rms = float(np.sqrt(told * np.mean(channel.noise**2)))
            channels.append(replace(channel, lasting=rms))
        seen = replace(observation, channels=tuple(channels))
        model = replace(refitted.model, observation=seen)
        return replace(refitted, model=model, residuals=residuals)

    # Of 40 drawn noises, none is taken for a misfit that lasts as it is told to; most are by the
    # test of white noise.
    assert all(is_noise(with_noise(0.7, 0.7)) for _ in range(40))
    assert sum(is_noise(with_noise(0.7, 0.0)) for _ in range(40)) < 10
    twice = with_noise(0.7, 0.7)
    assert not is_noise(replace(twice, residuals=2.0 * twice.residuals))


def test_channels_that_are_off_count_less(one_joint):
    refitted, _ = references(one_joint, ('tracker_bias', {'bias_rad': 0.2}))
    observation = refitted.model.observation
    residuals = refitted.residuals.copy()
    first, *_ = observation.slices()
    residuals[first] = 10.0
    weight = weights(observation, residuals)
    assert np.allclose(weight[first], 0.1)
    assert np.all(weight <= 1.0)


def test_another_form_widens_intervals_by_what_it_moves_the_numbers(one_joint):
    refitted, _ = references(one_joint)
    residuals, ways = other_forms(refitted, 8, 2)
    assert residuals.shape == (len(refitted.residuals), 8)
    moved = ways @ ways.T / 8
    named = [item.name for item in refitted.model.free]
    exponent = named.index('capstan_exponent')
    assert moved[exponent, exponent] > 0.0
    plain, wide = intervals(refitted), intervals(replace(refitted, moved_by_form=moved))
    assert wide[exponent].high > plain[exponent].high
    assert all(w.high >= p.high for w, p in zip(wide, plain, strict=True))


def told_of(one_joint, desired, *, cells=True):
    """What a recording of the described rig tells of its numbers."""
    plant = one_joint.rig()
    recording = one_joint.record(plant, desired)
    recording = recording if cells else replace(recording, tension=None)
    (observation,) = observe(recording, plant)
    packed = packed_joint(plant, 'bend_x')
    fitted, _ = nominal_references(observation, *packed)
    return nominal_estimates(fitted, packed[0])


def test_a_number_that_moves_no_channel_is_not_shown(one_joint):
    """A joint that its friction holds shows neither that nor what acts beyond it."""
    moved = told_of(one_joint, one_joint.motion(6.0))
    held = told_of(one_joint, 0.02 * np.sin(1.5 * 1e-3 * np.arange(6000)))
    of_joint = {'joint_stiffness', 'joint_friction', 'joint_presliding'}
    assert of_joint <= {name for name, e in moved.items() if e.shown}
    assert of_joint <= {name for name, e in held.items() if not e.shown}
    assert held['pretension'].shown
    for name in of_joint:
        one, other = held[name], moved[name]
        assert one.value == pytest.approx(one.nominal, rel=0.01)
        assert np.log(one.high / one.low) > 2.0 * np.log(other.high / other.low)


def test_two_numbers_that_only_go_together_name_each_other(one_joint):
    """So slow and small a motion shows by how much the motor lags, and not why."""
    small = 0.02 * np.sin(1.5 * 1e-3 * np.arange(6000))
    found = told_of(one_joint, small, cells=False)
    pair = ('motor_bandwidth', 'motor_damping_ratio')
    assert tuple(found[name].together_with for name in pair) == pair[::-1]
    # Numbers that are told apart well may be correlated as strongly.
    moved = told_of(one_joint, one_joint.motion(6.0))
    assert {e.together_with for e in moved.values()} == {''}

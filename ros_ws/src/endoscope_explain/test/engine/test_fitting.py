"""Where screening begins and where a fit of an onset ends."""

import math

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.compose import Composition, nominal_anchors, nominal_model
from endoscope_explain.fit.model import fit, jacobian
from endoscope_explain.fit.score import score
from endoscope_explain.fit.simulated_joint import packed_joint
from endoscope_explain.fit.whiteness import is_noise
from endoscope_explain.observation import observe
from endoscope_explain.onset_scan import redated
from endoscope_explain.refit_from_description import from_description, promised_by_description
from endoscope_explain.screen import promises, unexplained, with_effect


def anchors(one_joint, effect_id, parameters, *others):
    """Nominal plant, refitted and as described, of a rig that has an effect, and `others`."""
    plant = one_joint.rig()
    true = one_joint.rig(EffectSpec(effect_id, 'bend_x', parameters), *others)
    (observation,) = observe(one_joint.record(true, one_joint.motion()), plant)
    return nominal_anchors(observation, *packed_joint(plant, 'bend_x'))


def test_a_load_that_was_dated_seconds_late_is_dated_again(one_joint):
    refitted, _ = anchors(one_joint, 'external_load', {'moment_nm': 0.0008, 'time_s': 3.2})
    model = with_effect(refitted.model, 'external_load', {'moment_nm': 0.0006, 'time_s': 8.0})
    late = fit(model, model.begun_at(refitted.theta), iterations=10)
    first = CATALOGUE['external_load'].first_parameter
    again = redated(late)
    dated, _ = again.model.packed(again.theta)
    assert abs(late.model.packed(late.theta)[0][first + 1] - 3.2) > 1.0
    assert dated[first + 1] == pytest.approx(3.2, abs=0.05)
    assert dated[first] == pytest.approx(0.0008, rel=0.03)


def test_a_load_after_the_end_has_no_other_date(one_joint):
    refitted, _ = anchors(one_joint, 'gravity', {'moment_nm': 0.0006, 'phase_rad': 0.0})
    model = with_effect(refitted.model, 'external_load', {'moment_nm': 0.0, 'time_s': 60.0})
    never = fit(model, model.begun_at(refitted.theta), iterations=0)
    assert redated(never) is never


def test_a_disturbance_in_the_opposite_phase_is_promised_there(one_joint):
    _, described = anchors(
        one_joint, 'breathing', {'moment_nm': 0.0006, 'frequency_hz': 0.3, 'phase_rad': -2.5}
    )
    found = promises(unexplained(described), 'breathing')
    best = next(p for p in found if p.start['frequency_hz'] == pytest.approx(0.3))
    distance = math.remainder(best.start['phase_rad'] + 2.5, 2.0 * math.pi)
    assert abs(distance) < math.pi / 2.0


def test_a_limit_is_promised_as_it_stands_and_not_where_nothing_reaches_it(one_joint):
    _, described = anchors(one_joint, 'torque_limit', {'limit_nm': 0.01})
    found = promises(unexplained(described), 'torque_limit')
    assert found[0].start['limit_nm'] == pytest.approx(0.01, rel=0.05)
    gains = {p.start['limit_nm']: p.gain for p in found}
    assert gains[max(gains)] == pytest.approx(0.0, abs=1e-6)
    assert gains[min(gains)] < 0.99 * found[0].gain


def test_two_effects_are_found_from_the_described_plant_with_the_other_choice(one_joint):
    refitted, described = anchors(
        one_joint,
        'rate_limit',
        {'limit_rad_per_s': 0.75, 'of_command': 0.0},
        EffectSpec('transport_delay', 'bend_x', {'delay_s': 0.037}),
    )
    of_command = {'limit_rad_per_s': 0.75, 'of_command': 1.0}
    limited = with_effect(refitted.model, 'rate_limit', of_command)
    first = fit(limited, limited.begun_at(refitted.theta), iterations=10)
    late = with_effect(limited, 'transport_delay', {'delay_s': 0.03})
    both = fit(late, late.begun_at(first.theta), iterations=10)
    effects = ('rate_limit', 'transport_delay')
    found = from_description([Composition(effects, both, score(both))], described, 1)
    best = min(found, key=lambda c: c.score)
    values, _ = best.fit.model.packed(best.fit.theta)
    assert not is_noise(both)
    assert best.fit.cost < 0.5 * both.cost
    assert values[CATALOGUE['rate_limit'].first_parameter + 1] == 0.0
    delay = values[CATALOGUE['transport_delay'].first_parameter]
    assert delay == pytest.approx(0.037, rel=0.03)


def test_a_torque_limit_is_found_from_the_described_plant(one_joint):
    refitted, described = anchors(one_joint, 'torque_limit', {'limit_nm': 0.0101, 'droop': 1e-3})
    found = promised_by_description(described, ('torque_limit', 'gear_backlash', 'cogging'), 1)
    best = min(found, key=lambda c: c.score)
    assert not is_noise(refitted)
    assert best.effects == ('torque_limit',)
    assert is_noise(best.fit)


def test_a_number_that_may_hardly_move_has_a_derivative_over_a_wide_step(one_joint):
    plant = one_joint.rig()
    true = one_joint.rig(EffectSpec('stribeck_friction', 'bend_x', {'rise': 0.5}))
    (observation,) = observe(one_joint.record(true, one_joint.motion()), plant)
    narrow = nominal_model(observation, *packed_joint(plant, 'bend_x'), band=0.03)
    start = {'rise': 0.5, 'stribeck_speed': 2e-3}
    model = with_effect(narrow, 'stribeck_friction', start)
    low, high = model.bounds()
    theta = np.clip(model.begun_at(low[: len(narrow.free)]), low, high)
    derivative = jacobian(model, theta, model.residuals(theta))
    assert (high - low)[0] < model.step
    assert np.all(np.isfinite(derivative))
    assert np.any(derivative[:, 0] != 0.0)

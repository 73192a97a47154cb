"""What is searched, what is found, and what is said about it."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, PlantDescription, TermSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.evaluation import MULTIPLIES
from endoscope_core.physics.packing import pack
from endoscope_explain.decide.conclusions import plant_of
from endoscope_explain.decide.decision import decide
from endoscope_explain.fit.evidence import is_noise, mean_squares
from endoscope_explain.fit.family import family_at
from endoscope_explain.fit.model import jacobian, packed_joint, simulate_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.judging import BesideNullRigs
from endoscope_explain.search.levels import Level, search
from endoscope_explain.search.null_rigs import Null
from endoscope_explain.search.refit import Candidate, candidate
from endoscope_explain.search.screen import background, directions, gains, screened
from endoscope_explain.search.term import (
    LAGS,
    Term,
    begun_as_before,
    effects,
    functions,
    starting_points,
)


@pytest.fixture(scope='module')
def references(one_joint):
    """Makes the nominal plant, refitted and as described, of a rig with effects and functions."""

    def made(*terms, seconds=7.0):
        known = [term for term in terms if isinstance(term, EffectSpec)]
        functions = tuple(term for term in terms if isinstance(term, TermSpec))
        plant = one_joint.rig()
        true = replace(one_joint.rig(*known), terms=functions)
        (observation,) = observe(one_joint.record(true, one_joint.motion(seconds)), plant)
        return nominal_references(observation, *packed_joint(plant, 'bend_x'))

    return made


@pytest.fixture(scope='module')
def sound(references):
    """Of a rig as described."""
    return references()


def effect(name, **values):
    return EffectSpec(name, 'bend_x', values)


def starts_of(name):
    return tuple(Term(CATALOGUE[name], start) for start in starting_points(CATALOGUE[name]))


def screened_terms(found, name):
    behind = background(found)
    return screened(behind, directions(behind, starts_of(name), 1))


def test_a_disturbance_in_the_opposite_phase_is_screened_there(references):
    hidden = effect('breathing', moment_nm=0.0006, frequency_hz=0.3, phase_rad=-2.5)
    refitted, _ = references(hidden)
    near = [
        p.start['phase_rad']
        for p in screened_terms(refitted, 'breathing')
        if p.start['frequency_hz'] == pytest.approx(0.3)
    ]
    assert np.cos(near[0] + 2.5) > 0.0


def test_a_limit_is_screened_as_it_stands_and_not_where_nothing_reaches_it(references):
    _, described = references(effect('torque_limit', limit_nm=0.01))
    found = screened_terms(described, 'torque_limit')
    assert found[0].start['limit_nm'] == pytest.approx(0.01, rel=0.05)
    reached = [p.start['limit_nm'] for p in found]
    assert max(reached) < 0.03


def test_what_is_there_already_is_not_tried_again(sound):
    refitted, _ = sound
    tried = {term.id for term in (*effects(refitted), *functions(refitted, refitted.residuals))}
    assert {'gravity', 'load_of_angle', 'contact'} <= tried
    with_function = Term(FUNCTIONS['load_of_angle'], family=_family(refitted)).added_to(
        refitted.model
    )
    model = replace(refitted, model=with_function, theta=with_function.begun_at(refitted.theta))
    terms = (*effects(model, ('viscous_friction',)), *functions(model, model.residuals))
    tried = {term.id for term in terms}
    assert not tried & {'gravity', 'load_of_angle', 'contact', 'viscous_friction'}
    multiply = {term.id for term in terms if term.multiplies}
    assert {'load_of_speed', 'load_of_time'} <= multiply
    assert not multiply & {'load_of_angle', 'exponent_of_angle', 'tracker_of_angle'}
    assert 'stribeck_friction' in tried


def _family(found):
    terms = functions(found, found.residuals)
    return next(term.family for term in terms if term.id == 'load_of_angle')


def test_what_is_known_begins_at_the_numbers_that_it_had(sound):
    slow = {'moment_nm': 0.0005, 'frequency_hz': 0.0771, 'phase_rad': 0.3, 'second_harmonic': 0.0}
    known = {'breathing': slow, 'load_cell_bias': {'bias_n': 0.2, 'wire': 1.0}, 'gravity': {}}
    again = list(begun_as_before(effects(sound[0]), known))
    assert [(term.id, dict(term.start)) for term in again] == [
        ('breathing', slow),
        ('load_cell_bias', {'bias_n': 0.2, 'wire': 1.0}),
    ]
    assert again[1].variant == ('load_cell_bias', (1.0,))


def test_gains_by_linear_algebra_are_those_of_the_residuals_themselves(references):
    refitted, _ = references(effect('gravity', moment_nm=0.002))
    behind = background(refitted)
    ways = directions(behind, starts_of('gravity')[:2], 1)
    residuals = behind.left(refitted.residuals * behind.weight)[:, None]
    found = gains(behind, ways, residuals)
    way = ways[0]
    share = -float(way.columns[:, 0] @ residuals[:, 0]) / (1.0 + float(np.sum(way.columns**2)))
    left = residuals[:, 0] + share * way.columns[:, 0]
    for c, part in enumerate(refitted.model.observation.slices()):
        assert found.left[0, 0, c] == pytest.approx(float(np.mean(left[part] ** 2)), rel=1e-9)


def test_an_effect_is_found_by_its_formula_with_nothing_left(references):
    hidden = effect('joint_backlash', gap_rad=0.05)
    tried = search([references(hidden)], 2, known={'cogging': {}})
    decision = decide(tried, 2)
    assert [term.name for term in decision.missing] == [hidden.id]
    fitted = {term.id for each in tried.tried() for term in each.terms}
    assert 'cogging' in fitted, 'what is known from elsewhere is fitted in any case'
    assert decision.missing[0].contest.alternatives(hidden.id) == ()
    assert decision.adequate
    found = decision.chosen.fit
    assert np.sqrt(mean_squares(found.model.observation, found.residuals).max()) < 1.2
    assert decision.missing[0].p_value < 0.05


@pytest.mark.nightly
def test_two_effects_are_found_one_after_the_other(references):
    hidden = (
        effect('joint_inertia', inertia_kg_m2=2e-5),
        effect('tracker_drift', rate_rad_per_s=0.002),
    )
    decision = decide(search([references(*hidden, seconds=10.0)], 2), 2)
    assert {term.name for term in decision.missing} == {each.id for each in hidden}
    assert is_noise(decision.chosen.fit)


def test_nothing_is_searched_where_only_noise_is_left(sound):
    tried = search([sound], 2)
    assert tried.levels == ()
    assert decide(tried, 2).missing == ()


def _candidate(evidence, *terms, found=None):
    return Candidate(terms, (found,), evidence)


def _level(evidences, null):
    """A level whose candidates are a function of the angle, its formulas, and a tracker's."""
    place = FUNCTIONS['load_of_angle']
    function = Term(place, family=family_at(place, (-1.0, 1.0)))
    terms = {
        'function': function,
        'gravity': Term(CATALOGUE['gravity']),
        'tracker_delay': Term(CATALOGUE['tracker_delay']),
    }
    found = [_candidate(value, terms[name]) for name, value in evidences.items()]
    found.sort(key=lambda c: -c.evidence)
    null = np.asarray(null, dtype=float)
    return Level(_candidate(0.0), tuple(found), BesideNullRigs(Null(null, null)))


def test_a_formula_is_taken_where_it_loses_no_more_than_form_is_worth():
    close = _level({'function': 500.0, 'gravity': 480.0}, np.linspace(0.0, 50.0, 39))
    far = _level({'function': 500.0, 'gravity': 400.0}, np.linspace(0.0, 50.0, 39))
    assert close.best.terms[0].id == 'gravity'
    assert far.best.terms[0].id == 'load_of_angle'


def test_rivals_are_those_behind_by_no_more_than_form_is_worth():
    null = np.linspace(0.0, 50.0, 39)
    near = _level({'gravity': 500.0, 'tracker_delay': 470.0}, null)
    far = _level({'gravity': 500.0, 'tracker_delay': 440.0}, null)
    assert [c.terms[0].id for c in near.rivals()] == ['tracker_delay']
    assert far.rivals() == ()


def test_other_numbers_stand_where_a_term_does_hardly_more():
    near = _level({'gravity': 500.0}, np.linspace(0.0, 50.0, 39))
    numbers = _candidate(470.0)
    assert replace(near, found=(*near.found, numbers)).best is numbers
    far = _candidate(300.0)
    assert replace(near, found=(*near.found, far)).best is near.found[0]
    # Beside a term that was found before, too.
    (gravity,) = near.found[0].terms
    delay = Term(CATALOGUE['tracker_delay'])
    beside = Level(
        _candidate(400.0, gravity),
        (_candidate(500.0, gravity, delay), _candidate(470.0, gravity)),
        near.judge,
    )
    assert beside.best.terms == (gravity,)


@pytest.mark.nightly
def test_a_finer_sheath_alone_is_not_named(one_joint):
    """A rig whose friction has a profile finer than the fitted one lacks no physics."""
    plant = one_joint.rig()
    true = one_joint.rig(friction_profile=(0.0, 0.2, -0.1, 0.5, -0.4, 0.3))
    (observation,) = observe(one_joint.record(true, one_joint.motion(7.0)), plant)
    tried = search([nominal_references(observation, *packed_joint(plant, 'bend_x'))], 2)
    assert decide(tried, 2).missing == ()


def test_nothing_is_found_that_rigs_without_it_show_as_well():
    null = np.linspace(0.0, 1000.0, 39)
    assert not _level({'gravity': 500.0}, null).is_found
    assert _level({'gravity': 1001.0}, null).is_found
    assert _level({'gravity': 1001.0}, null).p_value == pytest.approx(1.0 / 40.0)
    seen = _level({'gravity': 1001.0}, null)
    assert not replace(seen, judge=replace(seen.judge, predicts=False)).is_found


def test_a_function_of_two_states_is_exported_as_a_product(sound):
    refitted, _ = sound
    family = _family(refitted)
    alone = Term(family.place, family=family.scaled(1e-4))
    model = alone.added_to(refitted.model)
    found = replace(refitted, model=model, theta=model.begun_at(refitted.theta))
    both = next(
        term
        for term in functions(found, found.residuals)
        if term.multiplies and term.id == 'load_of_speed'
    )
    model = both.added_to(model)
    theta = model.begun_at(found.theta)
    theta[model.places_of_coefficients()[0]] = 0.05
    theta[model.places_of_coefficients()[1]] = 0.02
    fitted = replace(refitted, model=model, theta=theta, jacobian=jacobian(model, theta))
    described = PlantDescription().of_joints(['bend_x'])
    plant = plant_of(described, [candidate((alone, both), fitted)])
    assert [(term.place, term.multiplies) for term in plant.terms] == [
        ('load_of_angle', False),
        ('load_of_speed', True),
    ]
    parameters, flags = pack(plant)
    assert flags[0, FUNCTIONS['load_of_speed'].flag] == MULTIPLIES
    outputs = simulate_joint(model.observation, parameters[0], flags[0])
    assert np.isfinite(outputs).all()


def test_a_device_that_joints_share_has_one_number_in_the_plant(sound):
    refitted, _ = sound
    skew = next(term for term in effects(refitted) if term.id == 'clock_skew')
    fits = []
    for joint, rate in (('bend_x', 0.010), ('bend_y', 0.011)):
        model = skew.added_to(refitted.model)
        model = replace(model, observation=replace(model.observation, joint=joint))
        theta = model.begun_at(refitted.theta)
        theta[-1] = model.free[-1].coordinate(rate)
        slopes = jacobian(model, theta) * (1.0 if joint == 'bend_x' else 2.0)
        fitted = replace(refitted, model=model, theta=theta, jacobian=slopes)
        fits.append(candidate((skew,), fitted))
    plant = plant_of(PlantDescription(), fits)
    # The second one shows it twice as well.
    assert [s.parameters['skew'] for s in plant.effects] == pytest.approx([0.011, 0.011])
    pack(plant)


def test_an_argument_that_lags_is_tried_with_several_lags_and_the_fit_may_move_them(sound):
    refitted, _ = sound
    lagging = [
        term
        for term in functions(refitted, refitted.residuals)
        if term.id == 'length_of_lagging_tension'
    ]
    lags = [term.family.lag for term in lagging]
    assert lags == sorted(lags)
    assert len(set(lags)) == LAGS
    # What lags the longer goes the less far.
    reach = [term.family.high - term.family.low for term in lagging]
    assert reach == sorted(reach, reverse=True)
    model = lagging[0].added_to(refitted.model)
    theta = model.begun_at(refitted.theta)
    assert model.family_at(-1, theta).lag == pytest.approx(lags[0])
    theta[-1] += 0.1
    assert model.family_at(-1, theta).lag == pytest.approx(lags[0] * np.exp(0.1))

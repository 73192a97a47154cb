"""What is said of a joint, and what is left open."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_explain.decide import decision
from endoscope_explain.decide.decision import are_one, decide
from endoscope_explain.fit.family import family_at
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.judging import BesideNullRigs
from endoscope_explain.search.levels import JointSearch, Level
from endoscope_explain.search.null_rigs import Null
from endoscope_explain.search.refit import Candidate
from endoscope_explain.search.term import Term

SURE = BesideNullRigs(Null(np.zeros(60), np.zeros(60)))


@pytest.fixture(scope='module')
def nominal(one_joint):
    """A fitted rig in which nothing is missing."""
    plant = one_joint.rig()
    (observation,) = observe(one_joint.record(plant, one_joint.motion(3.0)), plant)
    fitted, _ = nominal_references(observation, *packed_joint(plant, 'bend_x'))
    return Candidate((), (fitted,), 0.0)


def with_term(one, name, evidence, residuals=None):
    """A candidate with one effect or function more, as if it had been fitted."""
    place = FUNCTIONS.get(name)
    family = None if place is None else family_at(place, (-1.0, 1.0))
    term = Term(place or CATALOGUE[name], family=family)
    model = term.added_to(one.fit.model)
    theta = model.begun_at(one.fit.theta)
    columns = len(theta) - len(one.fit.theta)
    slopes = np.hstack([one.fit.jacobian, np.ones((len(one.fit.residuals), columns))])
    left = one.fit.residuals if residuals is None else residuals
    fit = replace(one.fit, model=model, theta=theta, jacobian=slopes, residuals=left)
    return Candidate((term,), (fit,), evidence)


@pytest.mark.parametrize(('leaves', 'before', 'finding'), [(1, 0.8, 1), (9, 0.8, 0), (9, 3.0, 1)])
def test_a_function_of_no_name_that_repairs_form_is_no_finding(
    nominal, monkeypatch, leaves, before, finding
):
    def with_form(one, jobs):
        return replace(one, fits=(replace(one.fit, beyond_form=before),))

    monkeypatch.setattr(decision, '_with_form', with_form)
    best = with_term(nominal, 'length_of_angle', 500.0, leaves * nominal.fit.residuals)
    found = decide(JointSearch(nominal, (Level(nominal, (best,), SURE),)), 1)
    assert found.chosen.terms == best.terms
    assert [term.name for term in found.missing] == ['length_of_angle'] * finding
    assert found.repairs == ('length_of_angle',) * (1 - finding)
    assert (found.open is None) == finding


def test_fits_that_differ_by_less_than_noise_shows_are_one_statement(nominal, monkeypatch):
    monkeypatch.setattr(decision, 'may_be_absent', lambda fit, effect: False)
    near = with_term(nominal, 'gravity', 100.0)
    same = with_term(nominal, 'joint_stop', 99.0)
    other = with_term(nominal, 'tracker_delay', 98.0, nominal.fit.residuals + 1.0)
    assert are_one(near, same, nominal)
    assert not are_one(near, other, nominal)
    level = Level(nominal, (near, same, other), SURE)
    (term,) = decide(JointSearch(nominal, (level,)), 1).missing
    assert term.name == 'gravity'
    assert term.contest.names == (('gravity', 'joint_stop'), ('tracker_delay',))
    assert term.contest.found


def test_what_was_tried_in_vain_is_left_open(nominal):
    level = Level(nominal, (with_term(nominal, 'gravity', 10.0),))
    found = decide(JointSearch(nominal, (level,)), 1)
    assert (found.missing, found.open.names, found.open.found) == ((), (('gravity',),), False)


def test_a_function_and_the_formula_at_its_place_are_two_names(nominal):
    function = with_term(nominal, 'load_of_angle', 500.0)
    formula = with_term(nominal, 'gravity', 300.0, nominal.fit.residuals + 1.0)
    (term,) = decide(JointSearch(nominal, (Level(nominal, (function, formula), SURE),)), 1).missing
    assert term.name in {'gravity', 'load_of_angle'}
    assert set(term.contest.names) == {('load_of_angle',), ('gravity',)}

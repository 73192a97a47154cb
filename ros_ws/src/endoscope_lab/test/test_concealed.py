"""Rigs with something concealed: how they are drawn, and when what is said of them is right."""

import numpy as np
import pytest

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_lab.concealed.judge import Statement, judged, law_at_place, law_of_effect
from endoscope_lab.concealed.readings import misfit
from endoscope_lab.concealed.strata import STRATA, drawn_case

SEED = 1


@pytest.mark.parametrize(
    'stratum',
    [pytest.param(s, marks=() if s == 'mixed_forms' else pytest.mark.nightly) for s in STRATA],
)
def test_every_stratum_draws_the_same_case_for_the_same_seed(stratum):
    first, again = drawn_case(stratum, SEED), drawn_case(stratum, SEED)
    assert first.true == again.true
    for one, other in ((first.recording, again.recording), (first.second, again.second)):
        np.testing.assert_array_equal(one.tension.values, other.tension.values)
        assert np.isfinite(one.tension.values).all()
        assert np.isfinite(one.bending.values).all()
    assert bool(first.laws) == (first.moved > 0.0)


def test_the_rig_itself_predicts_its_second_recording_to_the_noise():
    case = drawn_case('mixed_forms', SEED)
    assert misfit(case.true, case.second, case.described.sensors) < 1.1
    assert misfit(case.described, case.second, case.described.sensors) > 2.0


def said(*names, rivals=()):
    """Statements on bend_x, or on the joint behind an `@`; all have the same rivals."""
    found = []
    for name in names:
        name, _, joint = name.partition('@')
        stage = str((FUNCTIONS.get(name) or CATALOGUE[name]).stage)
        found.append(Statement(name, joint or 'bend_x', stage, rivals))
    return found


GRAVITY = law_of_effect('gravity', 'bend_x')
DELAY = law_of_effect('tracker_delay', 'bend_x')
FORM = law_at_place('load_of_angle', 'bend_x')
STRANGE = law_at_place('length_of_angle', 'bend_x')


@pytest.mark.parametrize(
    ('laws', 'names', 'right'),
    [
        # first, place, stage, exact, in a set, false names
        ([GRAVITY], said('gravity'), (1, 1, 1, 1, 1, 0)),
        ([GRAVITY], said('load_of_angle'), (1, 1, 1, 1, 1, 0)),
        ([GRAVITY], said('contact'), (0, 1, 1, 0, 0, 1)),
        ([GRAVITY], said('breathing'), (0, 0, 1, 0, 0, 1)),
        ([GRAVITY], said('breathing', rivals=('gravity',)), (0, 0, 1, 0, 1, 1)),
        ([GRAVITY], said('gravity', 'cogging'), (1, 1, 1, 0, 1, 1)),
        ([GRAVITY], said('cogging', 'gravity'), (0, 0, 0, 0, 0, 1)),
        ([GRAVITY], said('gravity@bend_y'), (0, 0, 1, 0, 0, 1)),
        ([GRAVITY], [], (0, 0, 0, 0, 0, 0)),
        ([DELAY], said('tracker_delay@bend_y', 'tracker_delay'), (1, 1, 1, 1, 1, 0)),
        ([FORM], said('contact'), (1, 1, 1, 1, 1, 0)),
        ([FORM], said('contact', 'gravity'), (1, 1, 1, 0, 1, 0)),
        ([FORM], said('load_of_angle'), (1, 1, 1, 1, 1, 0)),
        ([FORM], said('load_of_time'), (0, 0, 1, 0, 0, 1)),
        ([STRANGE], said('length_of_angle'), (1, 1, 1, 1, 1, 0)),
        ([STRANGE], said('load_of_angle'), (1, 0, 0, 1, 1, 0)),
        ([STRANGE], said('gravity'), (0, 0, 0, 0, 0, 1)),
        ([GRAVITY, DELAY], said('tracker_delay', 'gravity'), (1, 1, 1, 1, 1, 0)),
        ([GRAVITY, DELAY], said('gravity'), (0, 0, 0, 0, 0, 0)),
        ([GRAVITY, DELAY], said('gravity', 'cogging', 'tracker_delay'), (0, 0, 0, 0, 0, 1)),
        ([], [], (1, 1, 1, 1, 1, 0)),
        ([], said('gravity'), (0, 0, 0, 0, 0, 1)),
    ],
)
def test_what_counts_as_right(laws, names, right):
    j = judged(laws, names)
    assert (j.first, j.place, j.stage, j.exact, j.in_set, j.false) == right


def test_the_form_of_the_rig_itself_is_no_false_name():
    also = frozenset({'exponent_of_tension', 'load_independent_friction'})
    assert judged([], said('exponent_of_tension'), also).exact
    assert judged([], said('load_independent_friction', 'gravity'), also).false == 1
    assert judged([GRAVITY], said('exponent_of_tension', 'gravity'), also).exact

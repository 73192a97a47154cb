"""Blind benchmark: how rigs with injected effects are drawn, and which reports are right."""

import dataclasses

import numpy as np
import pytest

from endoscope_core.physics.effects import CATALOGUE
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.term import evaluate
from endoscope_lab.concealed import motions
from endoscope_lab.concealed.forms import DRAWN, drawn_form, drawn_formula, visited
from endoscope_lab.concealed.judge import Statement, judged, law_at_place, law_of_effect
from endoscope_lab.concealed.readings import misfit, read
from endoscope_lab.concealed.rigs import described_rig, true_rig
from endoscope_lab.concealed.strata import PLACES, STRATA, drawn_case
from endoscope_lab.concealed.strength import moved, scaled_to

SEED = 1
DAILY = ('catalogue', 'mixed_forms', 'nulls')


@pytest.fixture(scope='module')
def rig():
    """Described and true rig of two joints, and a command."""
    draw = np.random.default_rng(SEED)
    described = described_rig(draw, 2)
    return described, true_rig(draw, described), motions.another(draw, 2)


@pytest.mark.parametrize(
    'stratum',
    [pytest.param(s, marks=() if s in DAILY else pytest.mark.nightly) for s in STRATA],
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


@pytest.mark.parametrize('effect', DRAWN)
def test_a_formula_of_no_strength_is_no_effect(effect, rig):
    _, true, command = rig
    formula = drawn_formula(np.random.default_rng(SEED), effect, 'bend_x', 30.0)
    with_it = dataclasses.replace(true, effects=(formula(0.0),))
    assert moved(read(true, command), read(with_it, command)) < 1e-9


@pytest.mark.parametrize('aim', [0.03, 0.15])
@pytest.mark.parametrize('effect', ['gravity', 'joint_stop', 'load_cell_gain'])
def test_strength_reaches_its_share_of_the_signal(effect, aim, rig):
    _, true, command = rig
    formula = drawn_formula(np.random.default_rng(SEED), effect, 'bend_x', 30.0)

    def seen(strength):
        return read(dataclasses.replace(true, effects=(formula(strength),)), command)

    strength, share = scaled_to(aim, seen)
    assert share == pytest.approx(aim, rel=0.05)
    assert moved(read(true, command), seen(strength)) == share


@pytest.mark.parametrize('place', PLACES)
def test_a_form_can_be_drawn_at_every_place_and_is_no_line(place, rig):
    _, true, command = rig
    argument = FUNCTIONS[place].argument
    low, high = visited(true, command, 'bend_x')[argument]
    assert low < high
    form, largest = drawn_form(np.random.default_rng(SEED), place, 'bend_x', (low, high))
    law = form(0.1 * largest)
    grid = np.linspace(*law.range, 200)
    values = evaluate(law.expression, argument.symbol, grid)
    assert np.sqrt(np.mean(values**2)) == pytest.approx(0.1 * largest, rel=0.05)
    assert np.corrcoef(grid, values)[0, 1] ** 2 < 0.82
    other, _ = drawn_form(np.random.default_rng(SEED + 1), place, 'bend_x', (low, high))
    assert other(1.0).expression != form(1.0).expression


def reported(*names, alternatives=()):
    """Statements on bend_x, or on the joint behind an `@`; all have the same alternatives."""
    found = []
    for name in names:
        name, _, joint = name.partition('@')
        stage = str((FUNCTIONS.get(name) or CATALOGUE[name]).stage)
        found.append(Statement(name, joint or 'bend_x', stage, alternatives))
    return found


GRAVITY = law_of_effect('gravity', 'bend_x')
DELAY = law_of_effect('tracker_delay', 'bend_x')
FORM = law_at_place('load_of_angle', 'bend_x')
STRANGE = law_at_place('length_of_angle', 'bend_x')


@pytest.mark.parametrize(
    ('laws', 'names', 'right'),
    [
        # first, place, stage, exact, in a set, false names
        ([GRAVITY], reported('gravity'), (1, 1, 1, 1, 1, 0)),
        ([GRAVITY], reported('load_of_angle'), (1, 1, 1, 1, 1, 0)),
        ([GRAVITY], reported('contact'), (0, 1, 1, 0, 0, 1)),
        ([GRAVITY], reported('breathing'), (0, 0, 1, 0, 0, 1)),
        ([GRAVITY], reported('breathing', alternatives=('gravity',)), (0, 0, 1, 0, 1, 1)),
        ([GRAVITY], reported('gravity', 'cogging'), (1, 1, 1, 0, 1, 1)),
        ([GRAVITY], reported('cogging', 'gravity'), (0, 0, 0, 0, 0, 1)),
        ([GRAVITY], reported('gravity@bend_y'), (0, 0, 1, 0, 0, 1)),
        ([GRAVITY], [], (0, 0, 0, 0, 0, 0)),
        ([DELAY], reported('tracker_delay@bend_y', 'tracker_delay'), (1, 1, 1, 1, 1, 0)),
        ([FORM], reported('contact'), (1, 1, 1, 1, 1, 0)),
        ([FORM], reported('contact', 'gravity'), (1, 1, 1, 0, 1, 0)),
        ([FORM], reported('load_of_angle'), (1, 1, 1, 1, 1, 0)),
        ([FORM], reported('load_of_time'), (0, 0, 1, 0, 0, 1)),
        ([STRANGE], reported('length_of_angle'), (1, 1, 1, 1, 1, 0)),
        ([STRANGE], reported('load_of_angle'), (1, 0, 0, 1, 1, 0)),
        ([STRANGE], reported('gravity'), (0, 0, 0, 0, 0, 1)),
        ([GRAVITY, DELAY], reported('tracker_delay', 'gravity'), (1, 1, 1, 1, 1, 0)),
        ([GRAVITY, DELAY], reported('gravity'), (0, 0, 0, 0, 0, 0)),
        ([GRAVITY, DELAY], reported('gravity', 'cogging', 'tracker_delay'), (0, 0, 0, 0, 0, 1)),
        ([], [], (1, 1, 1, 1, 1, 0)),
        ([], reported('gravity'), (0, 0, 0, 0, 0, 1)),
    ],
)
def test_what_counts_as_right(laws, names, right):
    j = judged(laws, names)
    assert (j.first, j.place, j.stage, j.exact, j.in_set, j.false) == right


def test_the_form_of_the_rig_itself_is_no_false_name():
    also = frozenset({'exponent_of_tension', 'load_independent_friction'})
    assert judged([], reported('exponent_of_tension'), also).exact
    assert judged([], reported('load_independent_friction', 'gravity'), also).false == 1
    assert judged([GRAVITY], reported('exponent_of_tension', 'gravity'), also).exact

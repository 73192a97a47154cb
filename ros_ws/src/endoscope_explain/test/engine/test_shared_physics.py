"""One choice of effects for several recordings of a rig whose tube changes."""

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.decide.decision import without_recording
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.fit.model import fit
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.null_rigs import null_of_several, shown
from endoscope_explain.search.screen import background, directions
from endoscope_explain.search.term import Term, effects, with_effect
from endoscope_explain.takes import shared_effects

pytestmark = pytest.mark.nightly

GAIN = 0.9
TUBES = (0.8, 1.0)
"""Capstan exponents."""


@pytest.fixture(scope='module')
def recordings(one_joint):
    return [
        one_joint.record(
            one_joint.rig(
                EffectSpec('load_cell_gain', 'bend_x', {'gain': GAIN, 'wire': 1.0}),
                capstan_exponent=exponent,
            ),
            one_joint.motion(3.0),
        )
        for exponent in TUBES
    ]


@pytest.fixture(scope='module')
def references(one_joint, recordings):
    found = []
    for recording in recordings:
        observations = observe(recording, one_joint.rig())
        _, (pair,) = with_references(recording, observations, one_joint.rig(), 0.15, 1)
        found.append({'bend_x': pair})
    return found


@pytest.fixture(scope='module')
def chosen(references):
    return [given['bend_x'] for given in shared_effects(references, 1, 2, lambda _: None)]


def test_another_form_gains_by_one_effect_for_all_recordings(references):
    fits = [each['bend_x'][0] for each in references]
    behind = [background(found) for found in fits]
    ways = [directions(each, effects(each.fit), 2) for each in behind]
    each = list(zip(behind, ways, fits, strict=True))
    screened = [shown(*one, 2) for one in each]
    best = {w[int(np.argmax(s.observed))].term.id for w, s in zip(ways, screened, strict=True)}
    assert best == {'load_cell_gain'}
    gains = [float(s.observed.max()) for s in screened]
    own = [
        null_of_several([b], [w], [f], gain, 2).drawn
        for (b, w, f), gain in zip(each, gains, strict=True)
    ]
    both = null_of_several(behind, ways, fits, sum(gains), 2).drawn
    assert np.mean(both) < np.mean(own[0]) + np.mean(own[1]) - 1.0


def test_what_all_recordings_lack_is_found_and_nothing_else(chosen):
    for given in chosen:
        assert [term.id for term in given.terms] == ['load_cell_gain']


def test_a_device_is_the_same_in_all_recordings_and_a_tube_is_not(chosen):
    gain = CATALOGUE['load_cell_gain'].first_parameter
    first, second = (given.base[gain : gain + 2] for given in chosen)
    assert first.tolist() == second.tolist() == pytest.approx([GAIN, 1.0], abs=0.005)
    for given in chosen:
        free = {item.name for item in given.free}
        assert 'gain' not in free
        assert 'capstan_exponent' in free


def test_a_recording_is_explained_by_the_physics_it_is_given(one_joint, recordings, chosen):
    for recording, given in zip(recordings, chosen, strict=True):
        explanation = explain_recording(
            recording, one_joint.rig(), band=0.15, given={'bend_x': given}, jobs=2
        )
        named = {e.id: e.parameters for e in explanation.effects}
        assert set(named) == {'load_cell_gain'}
        assert named['load_cell_gain']['gain'].value == pytest.approx(GAIN, abs=0.005)
        assert explanation.adequate


def test_what_given_physics_leaves_is_searched_for(one_joint, recordings):
    plant = one_joint.rig()
    observations = observe(recordings[0], plant)
    _, ((refitted, _),) = with_references(recordings[0], observations, plant, 0.15, 1)
    model = with_effect(refitted.model, CATALOGUE['cogging'], {})
    given = without_recording(
        (Term(CATALOGUE['cogging']),), fit(model, model.begun_at(refitted.theta))
    )
    explanation = explain_recording(recordings[0], plant, band=0.15, given={'bend_x': given})
    assert 'load_cell_gain' in [e.id for e in explanation.effects]
    assert explanation.adequate

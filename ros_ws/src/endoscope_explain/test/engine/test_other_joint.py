"""What was found beside one motion of the other joint, seen beside another one."""

import dataclasses

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec, PlantDescription
from endoscope_core.physics.layout import IN_OTHER_JOINT
from endoscope_explain.explain_recording import stands_beside
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.levels import JointSearch, Level, search


@pytest.fixture(
    scope='module',
    params=[pytest.param('load_cell_gain', marks=pytest.mark.nightly), 'cross_coupling'],
)
def searched(record, request):
    """An effect, its search on `bend_y` as if `bend_x` stood still, and how `bend_x` moved."""
    effect = EffectSpec(request.param, 'bend_y', {})
    recording = record(PlantDescription(effects=(effect,)), 6.0)
    plant = PlantDescription()
    observations = observe(recording, plant)
    _, references = with_references(recording, observations, plant, 0.15, 2)
    fitted, described = references[1]
    moved = fitted.model.observation.inputs[0, :, IN_OTHER_JOINT].copy()
    still = fitted.model.observation.beside(np.zeros_like(moved))
    pair = [
        dataclasses.replace(f, model=dataclasses.replace(f.model, observation=still))
        for f in (fitted, described)
    ]
    return request.param, search([tuple(pair)], 2, 1), moved


def test_only_what_depends_on_the_other_joint_is_searched_again(searched):
    effect, tried, moved = searched
    assert tried.levels
    assert stands_beside(tried, moved, (), 2) is (effect == 'load_cell_gain')


def test_a_level_at_which_nothing_could_be_tried_leaves_it_open(searched):
    _, tried, moved = searched
    without = JointSearch(tried.nominal, (Level(tried.nominal, ()),))
    assert not stands_beside(without, moved, (), 2)

"""What is said of a joint's compositions, and of two joints that one tracker reads."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.compose import Composition, nominal_anchors, nominal_model
from endoscope_explain.decision import Decision, decide, with_devices_agreed
from endoscope_explain.fit.intervals import may_be_absent
from endoscope_explain.fit.model import Fit, fit
from endoscope_explain.fit.score import score
from endoscope_explain.fit.simulated_joint import packed_joint
from endoscope_explain.observation import observe
from endoscope_explain.screen import with_effect
from endoscope_explain.search import JointSearch


def composition(*effects):
    """A composition as far as a decision looks into it."""
    return SimpleNamespace(effects=effects)


def decided(chosen, rivals):
    """A decision for one effect with rivals."""
    return Decision(
        composition(chosen), True, 0.9, {chosen: rivals}, {chosen: 50.0}, {chosen: 10.0}
    )


def search_of(*effects):
    """A search that tried single effects."""
    tried = [composition(effect) for effect in effects]
    return SimpleNamespace(tried=lambda: tried)


def test_a_late_tracker_is_late_for_both_joints():
    searches = [search_of('tracker_delay'), search_of('joint_inertia', 'tracker_delay')]
    decisions = [decided('tracker_delay', ()), decided('joint_inertia', ('tracker_delay',))]
    agreed = with_devices_agreed(searches, decisions)
    assert [d.chosen.effects for d in agreed] == [('tracker_delay',), ('tracker_delay',)]
    assert agreed[1].alternatives['tracker_delay'] == ()


def test_an_effect_without_that_rival_stays():
    searches = [search_of('tracker_delay'), search_of('joint_inertia', 'tracker_delay')]
    decisions = [decided('tracker_delay', ()), decided('joint_inertia', ('breathing',))]
    assert with_devices_agreed(searches, decisions) == decisions


def test_nothing_spreads_from_a_joint_that_is_itself_in_doubt():
    searches = [search_of('tracker_delay'), search_of('joint_inertia', 'tracker_delay')]
    decisions = [
        decided('tracker_delay', ('breathing',)),
        decided('joint_inertia', ('tracker_delay',)),
    ]
    assert with_devices_agreed(searches, decisions) == decisions


@pytest.fixture
def leaving(one_joint):
    """Makes a composition from what it leaves of the angle and of all else, in noise units."""
    plant = one_joint.rig()
    (observation,) = observe(one_joint.record(plant, one_joint.motion()), plant)
    model = nominal_model(observation, *packed_joint(plant, 'bend_x'))
    theta = np.array([item.mean for item in model.free])

    def made(effects, angle, others):
        residuals = np.concatenate(
            [
                np.full(part.stop - part.start, angle if c.quantity == 'bending' else others)
                for c, part in zip(observation.channels, observation.slices(), strict=True)
            ]
        )
        fit = Fit(model, theta, residuals, np.empty(0), model.cost(residuals, theta))
        return Composition(effects, fit, score(fit))

    return made


@pytest.mark.parametrize(
    ('left', 'named'),
    [(1.2, ('joint_inertia', 'tracker_drift')), (2.0, ('joint_inertia',))],
)
def test_a_small_second_effect_is_named_where_it_leaves_hardly_more_than_noise(
    leaving, left, named
):
    search = JointSearch(
        leaving((), 1e3, 1e3),
        (
            (leaving(('joint_inertia',), 17.0, 0.9),),
            (leaving(('joint_inertia', 'tracker_drift'), left, 0.9),),
        ),
    )
    assert decide(search).chosen.effects == named


def test_an_effect_that_does_no_more_than_a_number_beyond_its_band_explains_nothing(leaving):
    nominal, creeping = leaving((), 17.0, 17.0), leaving(('wire_creep',), 2.0, 2.0)
    assert decide(JointSearch(nominal, ((creeping,),))).adequate
    decision = decide(JointSearch(nominal, ((creeping,),), leaving((), 1.9, 1.9)))
    assert decision.chosen.effects == ()
    assert not decision.adequate


def test_an_effect_that_does_more_than_numbers_beyond_their_band_is_named(leaving):
    nominal, creeping = leaving((), 17.0, 17.0), leaving(('wire_creep',), 0.9, 0.9)
    decision = decide(JointSearch(nominal, ((creeping,),), leaving((), 1.9, 1.9)))
    assert decision.chosen.effects == ('wire_creep',)
    assert decision.adequate


def test_an_effect_whose_strength_may_be_nothing_is_not_named(one_joint):
    """A gap is added to what a rig without one left, and to what a rig with one left."""
    gap = CATALOGUE['joint_backlash']
    plant = one_joint.rig()
    concealed = EffectSpec('joint_backlash', 'bend_x', {'gap_rad': 0.06})
    named = []
    for true in (plant, one_joint.rig(concealed)):
        (observation,) = observe(one_joint.record(true, one_joint.motion()), plant)
        refitted, _ = nominal_anchors(observation, *packed_joint(plant, 'bend_x'))
        model = with_effect(refitted.model, gap.id, {'gap_rad': 0.02})
        found = fit(model, model.begun_at(refitted.theta), iterations=20)
        named.append(not may_be_absent(found, gap))
        nominal = Composition((), replace(refitted, residuals=refitted.residuals + 20.0), 1e4)
        search = JointSearch(nominal, ((Composition((gap.id,), found, score(found)),),))
        assert decide(search).chosen.effects == ((gap.id,) if named[-1] else ())
    assert named == [False, True]

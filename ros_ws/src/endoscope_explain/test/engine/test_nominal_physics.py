"""Nominal physics that a description lacks, found as an effect that was left out."""

from dataclasses import replace

import pytest

from endoscope_core.physics.effects import NOMINAL_PHYSICS
from endoscope_explain.explain_recording import explain_recording
from endoscope_explain.explanation import Verdict
from endoscope_explain.fit.model import packed_joint
from endoscope_explain.fit.nominal import nominal_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.search.term import effects

PIECE = NOMINAL_PHYSICS['servo_lag']
FIRST = PIECE.parameters[0]


def test_what_the_nominal_plant_lacks_is_named_with_its_number(one_joint):
    whole = one_joint.rig()
    joint = replace(whole.joints['bend_x'], **{FIRST.name: FIRST.off})
    described = replace(whole, joints={'bend_x': joint})
    found = explain_recording(one_joint.record(whole, one_joint.motion(7.0)), described, jobs=2)
    assert found.verdict is Verdict.MISSING_PHYSICS
    (named,) = found.effects
    assert named.id == PIECE.id
    assert named.parameters[FIRST.name].value == pytest.approx(30.0, rel=0.03)
    assert FIRST.name not in found.parameters['bend_x']
    (spec,) = found.augmented.effects
    assert spec.id == PIECE.id
    assert max(fit.ratio for fit in found.fit['augmented'].values()) < 1.3


def test_only_what_a_plant_lacks_is_looked_for(one_joint):
    whole = one_joint.rig(section_friction=0.3)
    (seen,) = observe(one_joint.record(whole, one_joint.motion(4.0)), whole)
    fitted, _ = nominal_references(seen, *packed_joint(whole, 'bend_x'))
    assert not {term.id for term in effects(fitted)} & set(NOMINAL_PHYSICS)
    base = fitted.model.base.copy()
    base[PIECE.first_parameter] = FIRST.off
    without = replace(fitted, model=replace(fitted.model, base=base))
    assert {term.id for term in effects(without)} & set(NOMINAL_PHYSICS) == {PIECE.id}

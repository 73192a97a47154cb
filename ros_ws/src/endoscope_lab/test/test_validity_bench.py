"""Slow changes of a rig in hours of work, and whether they are detected."""

import pytest

from endoscope_core.classifier.cnn_classifier import load_classifier
from endoscope_lab.papers.tracking_trial import calibrate, never_seen_tube
from endoscope_lab.validity import Slow, creeping, is_detected, plant_after


def test_wires_that_are_tightened_again_creep_again():
    assert creeping(2.0).lost == pytest.approx(1.6)
    assert creeping(2.01).lost < 0.2 < creeping(2.5).lost < creeping(4.0).lost


def test_slow_changes_of_a_rig_give_a_plant():
    tube = never_seen_tube(1, 0)
    now = plant_after(tube.plant, Slow(lost=1.0, factor=1.5, moment=1e-3))
    for name, joint in tube.plant.joints.items():
        assert now.joints[name].pretension == pytest.approx(joint.pretension - 1.0)
        assert now.joints[name].capstan_exponent == pytest.approx(1.5 * joint.capstan_exponent)
    assert [effect.id for effect in now.effects] == ['external_load'] * len(now.joints)


@pytest.mark.nightly
def test_a_tube_that_is_bent_again_is_detected_and_one_that_stays_is_not():
    tube = never_seen_tube(1, 0)
    first = calibrate(tube, load_classifier())
    assert first.plants
    assert is_detected(tube, Slow(factor=1.6), first, 1)
    assert not is_detected(tube, Slow(), first, 1)

"""What several recordings of a rig lack, judged by leaving each of them out."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.physics.description import EffectSpec
from endoscope_explain.fit.nominal import with_references
from endoscope_explain.observe.observation import observe
from endoscope_explain.observe.revisits import folds
from endoscope_explain.search.judging import FALSE_ALARMS, InRecordingsLeftOut
from endoscope_explain.search.left_out import chance, repeat_one_motion
from endoscope_explain.search.levels import search

GAINS = np.array([90.0, 110.0, 100.0, 120.0])


def test_gains_that_are_alike_are_no_chance_and_one_large_one_is():
    assert chance(GAINS) < 0.001
    assert chance(np.array([400.0, 10.0, -5.0, 15.0])) > 0.15
    assert chance(-GAINS) > 0.99
    assert chance(np.array([5.0, 5.0])) == 0.0
    assert chance(np.zeros(3)) == 1.0


def test_gains_of_every_recording_are_no_chance_however_unlike_they_are():
    assert chance(np.array([30.0, 300.0, 3000.0])) < 1e-6
    assert chance(np.array([-30.0, 300.0, 3000.0])) > 0.1


@pytest.mark.parametrize('duration', [3.0, 8.2, 30.0])
def test_each_sample_is_judged_once_and_far_from_what_is_fitted(duration):
    time = np.arange(0.0, duration, 0.01)
    found = folds(time)
    assert np.all(sum(judged.astype(int) for _, judged in found) == 1)
    for fitted, judged in found:
        assert fitted.any()
        apart = np.abs(time[fitted][:, None] - time[judged][None, :])
        assert apart.min() > 0.19


@pytest.fixture(scope='module')
def recorded(one_joint):
    """Three tubes of a rig whose section has friction; one of them leans on something."""
    wall = EffectSpec('contact', 'bend_x', {'angle_rad': 0.15, 'stiffness': 0.02})
    plant, found = one_joint.rig(), []
    for seed, exponent in enumerate((0.5, 0.7, 1.0)):
        rig = one_joint.rig(capstan_exponent=exponent, section_friction=0.4)
        rig = replace(rig, effects=(wall,) if seed == 1 else ())
        described = replace(
            plant, joints={'bend_x': replace(plant.joints['bend_x'], capstan_exponent=exponent)}
        )
        recording = one_joint.record(rig, one_joint.motion(6.0), seed)
        seen = tuple(each.coarser(5) for each in observe(recording, described))
        found.append((recording, seen, described))
    return found


@pytest.mark.nightly
def test_what_all_tubes_lack_is_named_and_what_one_of_them_has_is_not(recorded):
    tubes = [with_references(*each, 0.15, 1)[1][0] for each in recorded]
    tried = search(tubes, jobs=2, depth=1)
    assert tried.found.effects == ('section_friction',)
    first, *_ = tried.levels
    assert isinstance(first.judge, InRecordingsLeftOut)
    assert first.p_value <= FALSE_ALARMS
    mu = [
        item.value(float(theta))
        for each in tried.found.fits
        for item, theta in zip(each.model.free, each.theta, strict=True)
        if item.name == 'section_friction'
    ]
    # That of the tube with the wall is bent by it.
    assert mu[::2] == pytest.approx([0.4] * 2, abs=0.1)


def test_recordings_of_one_motion_are_told_from_those_of_several(recorded, one_joint):
    seen = [observation for _, (observation,), _ in recorded]
    assert repeat_one_motion(seen)
    plant = one_joint.rig()
    recording = one_joint.record(plant, 0.5 * one_joint.motion(4.0))
    (other,) = observe(recording, plant)
    assert not repeat_one_motion([*seen, other])

"""The classifier that comes with the package, which judges without PyTorch."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.classifier.classification import ClassifierError, UnseenTensionError
from endoscope_core.classifier.cnn_classifier import (
    INPUT,
    CnnClassifier,
    Estimates,
    HeldOutCalibration,
    course,
    load_classifier,
)
from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion
from endoscope_lab.dataset import CLASSES_DEG, random_instrument, record_calibration
from endoscope_lab.dataset.rig_variation import backlash_sizes, calibration_command, in_tube
from endoscope_lab.training.held_out_calibration import calibration_of, widest


@pytest.fixture(scope='module', params=CALIBRATION_MOTIONS)
def shipped(request):
    return load_classifier(motion=request.param)


def judgement(size_deg, none=0.0, distance=0.0, gap=0.0):
    sizes = np.deg2rad(np.atleast_1d(size_deg).astype(float))
    one = np.ones_like(sizes)
    return Estimates(sizes, 0.01 * one, none * one, distance * one, gap * one)


def strict():
    return CnnClassifier({}, HeldOutCalibration(1.0, 9.0, 0.5), CLASSES_DEG, 'sinusoid')


def test_the_slave_that_is_simulated_by_default_is_known(shipped):
    plant, motion = PlantDescription(), calibration_motion(shipped.motion)
    tension = simulate(plant, calibration_command(plant, motion)).tension.reshape(-1, 4)
    noise = np.random.default_rng(0).normal(0.0, 0.02, tension.shape)
    result = shipped.classify(tension + noise)
    assert result.holds(float(np.mean(backlash_sizes(plant))))


def test_sizes_beyond_the_classes_are_refused():
    sizes = judgement([20.0, 36.0, 70.0, 104.0, 120.0])
    refused = strict().reasons_to_refuse(sizes)
    assert [bool(reason) for reason in refused] == [True, False, False, False, True]
    assert 'outside the 35 to 105 deg' in refused[0]
    named = [result.class_deg for result in strict().results(sizes)]
    assert named == [40, 40, 70, 100, 100]


def test_what_is_none_or_far_from_the_training_is_refused():
    assert 'disturbed cells' in strict().reasons_to_refuse(judgement(70.0, none=0.6))[0]
    assert 'too far' in strict().reasons_to_refuse(judgement(70.0, distance=9.1))[0]
    assert '0.4 N another' in strict().reasons_to_refuse(judgement(70.0, gap=0.42))[0]


def test_a_cell_that_drifts_is_refused_since_no_loop_closes(shipped):
    motion = calibration_motion(shipped.motion)
    plant = in_tube(random_instrument(np.random.default_rng(0)), 1.5)
    tension = record_calibration(plant, 0, motion).tension
    assert shipped.judged(course(tension, motion.name)[None]).gap < 0.15
    tension[:, 2] += np.linspace(0.0, 1.5, motion.samples)
    with pytest.raises(UnseenTensionError, match='drifts, or the motion was another'):
        shipped.classify(tension)


def test_the_class_is_the_nearest_and_its_probability_what_lies_between_its_borders():
    [result] = strict().results(judgement(74.0))
    assert result.class_deg == 70
    assert sum(result.probabilities.values()) == pytest.approx(1.0)
    # One deviation of 0.01 / 1.645 rad is 0.348 deg: the border is 2.87 of them away.
    assert result.probabilities[80] == pytest.approx(0.00204, rel=0.02)
    assert np.rad2deg(result.interval) == pytest.approx([74.0 - 0.573, 74.0 + 0.573], abs=1e-3)


def test_a_recording_of_another_motion_or_with_gaps_is_refused(shipped):
    with pytest.raises(ClassifierError, match='have shape'):
        shipped.classify(np.zeros((17, 4)))
    broken = np.full((calibration_motion(shipped.motion).samples, 4), 5.0)
    broken[3, 1] = np.inf
    with pytest.raises(ClassifierError, match='not finite'):
        shipped.classify(broken)


@pytest.mark.parametrize('motion', CALIBRATION_MOTIONS)
def test_the_course_is_the_logarithm_of_what_has_settled(motion):
    recorded = calibration_motion(motion)
    time = np.arange(recorded.samples) * 1e-3
    tension = np.stack([time, 5.0 + time, time - 9.0, 0.0 * time], axis=1)
    read = course(tension, motion)
    begin = recorded.samples - INPUT if motion == 'sinusoid' else recorded.settled
    assert read.shape == (INPUT, 4)
    np.testing.assert_allclose(read[[0, -1], 0], np.log(time[[begin, -1]] + 0.5), rtol=1e-5)
    np.testing.assert_allclose(read[:, 2:], np.log(0.5), rtol=1e-6)


def test_intervals_hold_their_nominal_share_and_known_tubes_pass():
    generator = np.random.default_rng(0)
    true, deviation = generator.random(4000), 0.1 + generator.random(4000)
    error = 3.0 * deviation * generator.standard_normal(4000)
    columns = true + error, deviation, generator.random(4000), generator.random(4000), 0.0 * true
    first, rest = (Estimates(*(x[k : k + 2000] for x in columns)) for k in (0, 2000))
    calibration = calibration_of(first, true[:2000], first)
    assert calibration.inflation == pytest.approx(3.0 * 1.645, rel=0.08)
    covered = np.abs(error[2000:]) <= calibration.inflation * deviation[2000:]
    assert 0.87 < np.mean(covered) < 0.93
    smaller = HeldOutCalibration(0.5 * calibration.inflation, 2.0, 0.0)
    assert widest([calibration, smaller]) == replace(calibration, ceiling=2.0)
    classifier = CnnClassifier({}, calibration, CLASSES_DEG, 'sinusoid')
    unlike = [
        reason
        for reason in classifier.reasons_to_refuse(rest)
        if reason and 'outside the' not in reason
    ]
    assert 0.001 < len(unlike) / 2000 < 0.01

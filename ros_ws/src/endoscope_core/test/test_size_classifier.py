import dataclasses
import json

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, DotProduct, WhiteKernel

from endoscope_core.classifier.classification import ClassifierError, UnseenTensionError
from endoscope_core.classifier.grouped_folds import grouped_folds
from endoscope_core.classifier.shipped import load_classifier
from endoscope_core.classifier.size_classifier import HeldOutCalibration, SizeClassifier
from endoscope_core.classifier.size_model import SizeEstimate, fitted_size_model
from endoscope_core.classifier.size_training import (
    calibration_of,
    save_size_classifier,
    train_size_classifier,
    validated_size_classifier,
)
from endoscope_core.classifier.tension_features import log_courses, roughness
from endoscope_core.classifier.weights_file import sealed
from endoscope_core.dataset import (
    CLASSES_DEG,
    CalibrationDataset,
)
from endoscope_core.signals import CALIBRATION_MOTIONS, calibration_motion


@pytest.fixture(scope='module', params=CALIBRATION_MOTIONS)
def shipped(request):
    return load_classifier(motion=request.param)


@pytest.fixture(scope='module')
def easy():
    """Recordings whose sizes lie anywhere, and whose tensions follow them plainly."""
    generator = np.random.default_rng(0)
    classes = np.repeat(CLASSES_DEG, 6)
    size = classes + generator.uniform(-1.0, 1.0, classes.size)
    time = np.arange(3140) * 1e-3
    stiffness = generator.uniform(0.9, 1.1, classes.size)
    swing = np.sin(2.5 * time - 0.01 * size[:, None]) * stiffness[:, None] * 3.0
    wires = 5.0 + np.stack([swing, -swing, swing, -swing], axis=2)
    tension = (wires + generator.normal(0.0, 0.02, wires.shape)).astype(np.float32)
    return CalibrationDataset(
        tension=tension,
        desired_angle=time,
        desired_velocity=time,
        actual_angle=np.zeros((classes.size, 3140, 2), np.float32),
        class_deg=classes,
        joint_size=np.deg2rad(np.stack([size, size], axis=1)),
        configuration=np.arange(classes.size),
        manifest={'seed': 0, 'per_class': 6, 'motion': 'brief'},
    )


def test_the_tensions_of_standing_motors_are_refused(shipped):
    samples = calibration_motion(shipped.motion).samples
    still = np.random.default_rng(0).normal(5.0, 0.02, (samples, 4))
    with pytest.raises(UnseenTensionError):
        shipped.classify(still)


def test_sizes_beyond_the_classes_are_refused():
    generator = np.random.default_rng(0)
    classifier = SizeClassifier(
        fitted_size_model(generator.random((6, 100, 4)), generator.random((6, 2)), steps=1),
        HeldOutCalibration(1.0, (9.0, 9.0, 9.0)),
        CLASSES_DEG,
        'brief',
    )
    sizes = np.deg2rad([20.0, 36.0, 70.0, 104.0, 120.0])
    estimate = SizeEstimate(sizes, np.full(5, 0.01), np.zeros((5, 3)))
    refused = classifier.reasons_to_refuse(estimate)
    assert [bool(reasons) for reasons in refused] == [True, False, False, False, True]
    assert 'outside the 35 to 105 deg' in refused[0][0]
    named = [result.class_deg for result in classifier.results(estimate)]
    assert named == [40, 40, 70, 100, 100]


def test_a_recording_of_another_motion_or_with_gaps_is_refused(shipped):
    with pytest.raises(ClassifierError, match='have shape'):
        shipped.classify(np.zeros((17, 4)))
    broken = np.full((calibration_motion(shipped.motion).samples, 4), 5.0)
    broken[3, 1] = np.inf
    with pytest.raises(ClassifierError, match='not finite'):
        shipped.classify(broken)


def test_courses_are_means_of_fifty_samples_of_each_joints_wires():
    tension = 5.0 * np.random.default_rng(0).random((3, 120, 4))
    courses = log_courses(tension)
    assert courses.shape == (3, 2, 4)
    expected = np.log(np.mean(tension[2, 50:100, 3]) + 0.5)
    assert courses[2, 1, 3] == pytest.approx(expected, rel=1e-12)


def test_roughness_is_the_noise_and_not_the_motion():
    time = np.arange(9000) * 1e-3
    noise = np.random.default_rng(0).normal(0.0, 0.02, (1, 9000, 4))
    tension = 5.0 + 4.0 * np.sin(2.0 * time)[None, :, None] + noise
    np.testing.assert_allclose(roughness(tension), 0.02, rtol=0.05)


def test_intervals_hold_the_share_that_they_promise():
    generator = np.random.default_rng(0)
    true, deviation = generator.random(4000), 0.1 + generator.random(4000)
    error = 3.0 * deviation * generator.standard_normal(4000)
    strange = generator.standard_normal((4000, 3))
    estimate = SizeEstimate(true + error, deviation, strange)
    half = SizeEstimate(*(x[:2000] for x in vars(estimate).values()))
    calibration = calibration_of(half, true[:2000])
    assert calibration.inflation == pytest.approx(3.0 * 1.645, rel=0.08)
    covered = np.abs(error[2000:]) <= calibration.inflation * deviation[2000:]
    assert 0.87 < np.mean(covered) < 0.93
    assert all(4.0 < ceiling < 6.0 for ceiling in calibration.ceilings)


@pytest.fixture(scope='module')
def process(easy):
    """The fitted model, and scikit-learn's Gaussian process with its covariance."""
    model = fitted_size_model(easy.tension, easy.joint_size, steps=20)
    bump = ConstantKernel(model.height**2) * RBF(model.lengths)
    line = ConstantKernel(model.linear**2) * DotProduct(0.0, 'fixed')
    kernel = bump + line + WhiteKernel(model.noise**2)
    jitter = 1e-9 * np.mean(np.diag(model.covariance(model.scores, model.scores)))
    known = GaussianProcessRegressor(kernel, alpha=jitter, optimizer=None)
    return model, known.fit(model.scores, model.target - np.mean(model.target))


def test_the_likelihood_and_its_slope_are_those_of_scikit_learn(process):
    model, known = process
    value, slope = model.log_likelihood()
    theirs, by_theta = known.log_marginal_likelihood(known.kernel_.theta, eval_gradient=True)
    constant = 0.5 * len(model.target) * np.log(2.0 * np.pi)
    assert value - constant == pytest.approx(theirs, rel=1e-6)
    # Their hyperparameters are the logarithms of variances, ours of standard deviations.
    height, *lengths, linear, noise = by_theta
    expected = [*lengths, 2.0 * linear, 2.0 * height, 2.0 * noise]
    # In ours the jitter grows with the covariance.
    np.testing.assert_allclose(slope, expected, rtol=1e-3, atol=1e-3)


def test_size_and_deviation_are_those_of_scikit_learn(process, easy):
    model, known = process
    unseen = easy.tension[::7] * 1.01
    deviation = log_courses(unseen.astype(np.float64)) - model.centre
    scores = (deviation @ model.basis.T / model.spread).reshape(-1, len(model.basis))
    size, spread = known.predict(scores, return_std=True)
    found = model.estimate(unseen)
    size = np.mean(size.reshape(-1, 2) + np.mean(model.target), axis=1)
    np.testing.assert_allclose(found.size, size, atol=1e-7)
    np.testing.assert_allclose(found.deviation, spread.reshape(-1, 2).mean(axis=1), rtol=1e-5)


def test_fitting_makes_what_is_known_likelier(easy):
    values = [
        fitted_size_model(easy.tension, easy.joint_size, steps).log_likelihood()[0]
        for steps in (0, 10, 40)
    ]
    assert values == sorted(values)
    assert values[2] > values[0] + 10.0


def test_folds_keep_a_configuration_on_one_side(easy):
    shared = dataclasses.replace(easy, configuration=easy.configuration // 2)
    for train, test in grouped_folds(shared, 0, 3):
        inside = set(shared.configuration[train]) & set(shared.configuration[test])
        assert not inside
        assert len(train) + len(test) == len(easy.class_deg)


def test_validation_is_of_recordings_held_out_and_training_repeats(easy):
    classifier, validation = validated_size_classifier(easy, 0, 3)
    assert validation.classes.mean_accuracy > 0.9
    assert max(validation.rmse) < np.deg2rad(3.0)
    assert validation.share_within(0.9) == pytest.approx(np.mean(validation.coverage), abs=0.02)
    shares = [validation.share_within(level) for level in (0.1, 0.5, 0.99)]
    assert shares == sorted(shares)
    assert validation.classes.confusion.sum() == len(easy.class_deg)
    again = train_size_classifier(easy, 0, 3)
    assert again.calibration == classifier.calibration
    np.testing.assert_array_equal(again.model.target, classifier.model.target)


def test_what_is_saved_gives_the_same_answer(easy, tmp_path):
    classifier, validation = validated_size_classifier(easy, 0, 3)
    path = tmp_path / 'size.safetensors'
    save_size_classifier(path, classifier, easy, validation, 'endoscope train', 0)
    loaded = load_classifier(path, 'brief')
    first, second = (c.classify(easy.tension[10]) for c in (classifier, loaded))
    assert first.size == pytest.approx(second.size, abs=1e-9)
    assert first.interval == pytest.approx(second.interval, abs=1e-9)
    described = json.loads(path.with_suffix('.json').read_text())
    assert described['held_out']['confusion'] == validation.classes.confusion.tolist()
    with pytest.raises(ClassifierError, match='trained on the brief calibration'):
        load_classifier(path, 'sinusoid')


def test_weights_that_do_not_fit_are_one_clear_error(easy, tmp_path):
    classifier, validation = validated_size_classifier(easy, 0, 3)
    path = tmp_path / 'size.safetensors'
    save_size_classifier(path, classifier, easy, validation, 'endoscope train', 0)
    described = json.loads(path.with_suffix('.json').read_text())
    del described['inflation']
    path.with_suffix('.json').write_text(json.dumps(sealed(described, path.read_bytes())))
    with pytest.raises(ClassifierError, match='no classifier weights'):
        load_classifier(path, 'brief')
    path.with_suffix('.json').write_text('{"schema": 1}')
    with pytest.raises(ClassifierError, match='schema'):
        load_classifier(path, 'brief')

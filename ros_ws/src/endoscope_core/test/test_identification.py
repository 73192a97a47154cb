import json

import numpy as np
import pytest

from endoscope_core.errors import FileError, InputError
from endoscope_core.hysteresis import BoucWenParameters, forward
from endoscope_core.identification import (
    HysteresisRecording,
    Servo,
    fit_model,
    load_class_parameters,
    parameters_for_class,
)
from endoscope_core.signals import calibration_sinusoid

CLASSES_DEG = (40, 50, 60, 70, 80, 90, 100)
TRUE = BoucWenParameters.from_shape(alpha=0.91, lag=0.55, travel=0.42, rho=0.45, n=2.0)
TIME = np.arange(0.0, 9.0, 0.02)
DRIVER = calibration_sinusoid()(TIME)[0]


def recording(noise, seed=0, offset=0.0, y0=0.0, rested=True):
    measured = forward(TRUE, DRIVER, y0) + offset
    measured += np.random.default_rng(seed).normal(0.0, noise, TIME.size)
    return HysteresisRecording(DRIVER, measured, rested)


def test_it_finds_the_parameters_that_made_a_recording():
    fit = fit_model([recording(0.0)])
    assert fit.rmse < 1e-4
    for name, value in TRUE.to_dict().items():
        found = fit.parameters.to_dict()[name]
        assert found == pytest.approx(value * TRUE.A, rel=0.02, abs=0.02), name


def test_noise_offset_and_an_unknown_start_are_borne():
    many = [recording(0.005, k, offset=0.05 * k, y0=0.4, rested=False) for k in range(3)]
    fit = fit_model(many)
    assert fit.rmse == pytest.approx(0.005, rel=0.1)
    assert fit.parameters.lag == pytest.approx(TRUE.lag, rel=0.02)
    assert fit.parameters.alpha == pytest.approx(TRUE.alpha, rel=0.02)


def test_the_search_repeats_with_its_seed():
    assert fit_model([recording(0.01)], 4).parameters == fit_model([recording(0.01)], 4).parameters


def test_a_straight_line_has_no_lag_and_stays_in_bounds():
    noise = np.random.default_rng(0).normal(0.0, 0.002, TIME.size)
    fit = fit_model([HysteresisRecording(DRIVER, 0.8 * DRIVER + noise)])
    assert fit.parameters.lag < 0.01
    assert fit.parameters.alpha == pytest.approx(0.8, rel=0.01)


def test_the_servo_settles_on_its_command_and_lags_by_its_damping():
    time = np.arange(0.0, 4.0, 0.004)
    servo = Servo()
    ramp = servo.answer(0.7 * time, 0.004)
    # A command held for 4 ms is itself half of that late.
    late = 2.0 * servo.damping_ratio / servo.bandwidth + 0.002
    assert 0.7 * time[-1] - ramp[-1] == pytest.approx(0.7 * late, rel=1e-3)
    still = Servo().answer(np.full(500, 0.3), 0.004)
    np.testing.assert_allclose(still, 0.3)


@pytest.mark.parametrize(
    ('recordings', 'complaint'),
    [
        ([], 'no recording'),
        ([HysteresisRecording(DRIVER[:50], DRIVER[:50])], 'at least 100'),
        ([HysteresisRecording(DRIVER, np.full(TIME.size, np.nan))], 'finite'),
        ([HysteresisRecording(DRIVER, np.zeros(TIME.size))], 'less than 1 deg'),
        ([HysteresisRecording(DRIVER, DRIVER[:-1])], 'differ in length'),
    ],
)
def test_a_recording_without_hysteresis_is_refused(recordings, complaint):
    with pytest.raises(InputError, match=complaint):
        fit_model(recordings)


def classes_of(parameters):
    return json.dumps({'model': 'bouc_wen', 'classes': {'40': {'feedforward': parameters}}})


def test_shipped_sets_cover_every_class_and_bend_less_in_tighter_tubes():
    sets = load_class_parameters()
    assert sorted(sets) == sorted(CLASSES_DEG)
    assert np.all(np.diff([sets[c].alpha for c in CLASSES_DEG]) < -0.01)
    assert all(0.25 < sets[c].lag < 0.35 for c in CLASSES_DEG)
    assert parameters_for_class(sets, 70) is sets[70]
    with pytest.raises(InputError, match='class 55'):
        parameters_for_class(sets, 55)


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        ('no json', 'holds no bouc_wen'),
        ('[]', 'holds no bouc_wen'),
        ('{}', 'holds no bouc_wen'),
        (classes_of({'alpha': 1.0}), 'holds no bouc_wen'),
        (classes_of({**TRUE.to_dict(), 'alpha': -1.0}), 'holds no bouc_wen'),
        ('{"model": "play", "classes": {}}', 'of play, not of bouc_wen'),
    ],
)
def test_a_file_without_safe_parameters_is_refused(tmp_path, content, words):
    path = tmp_path / 'classes.json'
    path.write_text(content)
    with pytest.raises(FileError, match=words):
        load_class_parameters(path)
    with pytest.raises(FileError, match='is missing'):
        load_class_parameters(tmp_path / 'none.json')

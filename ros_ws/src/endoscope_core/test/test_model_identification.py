import itertools

import numpy as np
import pytest
from play_loop import play

from endoscope_core.errors import InputError
from endoscope_core.hysteresis import MODELS, DahlParameters, forward
from endoscope_core.hysteresis.memory_model import (
    GREATEST_ALPHA,
    GREATEST_INVERSE_SLOPE,
    SMALLEST_ALPHA,
)
from endoscope_core.identification import HysteresisRecording, Servo, fit_feedforward, fit_model
from endoscope_core.identification.feedforward_fit import candidates_for

TIME = np.arange(0.0, 9.0, 0.02)
DRIVER = 1.5 * np.sin(TIME)
TRUTH = DahlParameters(0.85, 0.5, 0.4, 1.7, 0.05)


def test_a_model_is_found_again():
    fit = fit_model([HysteresisRecording(DRIVER, forward(TRUTH, DRIVER))], 0, 'dahl')
    np.testing.assert_allclose(fit.predict(DRIVER), forward(TRUTH, DRIVER), atol=0.002)
    assert fit.rmse < 1e-3
    assert 'dahl' in str(fit)


@pytest.mark.parametrize(
    'gain', [SMALLEST_ALPHA, pytest.param(GREATEST_ALPHA, marks=pytest.mark.nightly)]
)
@pytest.mark.parametrize('model', MODELS)
def test_every_candidate_for_the_inverse_is_safe_whatever_the_gain_of_the_rig(model, gain):
    fit = fit_model([HysteresisRecording(DRIVER, gain * forward(TRUTH, DRIVER))], 0, model)
    candidates = candidates_for(fit.parameters)
    for corner in itertools.product(*candidates.bounds):
        parameters = candidates.make(corner)
        assert parameters.inverse_slope <= GREATEST_INVERSE_SLOPE * (1.0 + 1e-9)


@pytest.mark.parametrize(
    'model', [pytest.param(m, marks=pytest.mark.nightly if m == 'bouc_wen' else ()) for m in MODELS]
)
def test_whatever_is_recorded_what_comes_out_is_safe(model):
    generator = np.random.default_rng(0)
    driver = DRIVER[::4]
    wild = np.cumsum(generator.normal(0.0, 0.3, driver.size)) - 3.0 * driver
    fit = fit_model([HysteresisRecording(driver, wild, rested=False)], 0, model)
    assert fit.parameters.inverse_slope <= GREATEST_INVERSE_SLOPE * (1.0 + 1e-9)
    again = MODELS[model].from_dict(fit.parameters.to_dict())
    assert again == fit.parameters


def test_the_feed_forward_of_a_model_makes_a_backlash_follow():
    fit = fit_model([HysteresisRecording(DRIVER, play(DRIVER, 0.5))], 0, 'dahl')
    found = fit_feedforward(fit.parameters, Servo(), lead=0.06)
    assert found.rmse < 0.35 * found.uncompensated_rmse
    assert found.parameters.inverse_slope <= GREATEST_INVERSE_SLOPE
    assert isinstance(found.parameters, DahlParameters)


def test_an_unknown_model_is_refused():
    with pytest.raises(InputError, match='choose one of'):
        fit_model([HysteresisRecording(DRIVER, DRIVER)], 0, 'preisach')

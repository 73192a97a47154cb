import numpy as np
import pytest
from outside_data import REAL, needs

from endoscope_core.hysteresis import DahlParameters, forward
from endoscope_core.hysteresis.inverse import MODELS
from endoscope_core.identification import fit_model
from endoscope_lab.papers.real_recordings import (
    closed_cycle,
    hysteresis_model,
    models_on_real_recordings,
    real_recordings,
)
from endoscope_lab.real.prandtl_ishlinskii import fitted

RECORDINGS = real_recordings()
where_they_are_at_hand = needs(REAL)


@where_they_are_at_hand
@pytest.mark.parametrize(
    ('predicted', 'at_most_deg'), [(hysteresis_model('bouc_wen', 0), 1.02), (fitted, 1.01)]
)
def test_the_straight_tube_is_modelled_as_well_as_is_known_to_be_possible(predicted, at_most_deg):
    straight = [recording for recording in RECORDINGS if recording.bend == 0]
    _, second = models_on_real_recordings(straight, predicted)[0]
    assert np.rad2deg(second) <= at_most_deg


@where_they_are_at_hand
@pytest.mark.parametrize('model', MODELS)
def test_a_model_explains_most_of_the_second_cycle_of_the_most_bent_tube(model):
    found = models_on_real_recordings(RECORDINGS[-1:], hysteresis_model(model, 0))
    for _, second in found.values():
        assert np.rad2deg(second) < 3.0


def test_a_closed_cycle_says_that_loops_close():
    # One that saturates within half a cycle, so that its period closes after the first turn.
    truth = DahlParameters(0.85, 0.5, 0.1, 1.0, 0.05)
    driver = np.sin(np.arange(0.0, 2.0 * np.pi, 0.02))
    actual = forward(truth, np.tile(driver, 2))[: driver.size]
    recording = closed_cycle(driver, actual)
    assert recording.scored.sum() < recording.driver.size
    assert recording.scored[: driver.size].all()
    fit = fit_model([recording], 0, 'dahl')
    np.testing.assert_allclose(fit.predict(np.tile(driver, 2))[: driver.size], actual, atol=0.003)


def test_a_sum_of_plays_is_found_again():
    driver = 1.5 * np.sin(np.arange(0.0, 9.0, 0.02))
    state, actual = 0.0, []
    for angle in driver:
        state = min(max(state, angle - 0.45), angle + 0.45)
        actual.append(0.1 * angle + 0.7 * state + 0.02)
    recording = closed_cycle(driver, np.array(actual))
    np.testing.assert_allclose(fitted(recording, driver), actual, atol=0.002)

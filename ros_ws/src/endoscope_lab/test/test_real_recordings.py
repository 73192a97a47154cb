import numpy as np
import pytest
from outside_data import REAL, needs

from endoscope_core.hysteresis import MODELS
from endoscope_core.identification import HysteresisRecording
from endoscope_lab.papers.real_recordings import hysteresis_model, left_of_the_rest, real_recordings
from endoscope_lab.real.prandtl_ishlinskii import fitted

RECORDINGS = real_recordings()
where_they_are_at_hand = needs(REAL)


@where_they_are_at_hand
@pytest.mark.parametrize(
    ('predicted', 'at_most_deg'), [(hysteresis_model('bouc_wen', 0), 1.02), (fitted, 1.01)]
)
def test_the_straight_tube_is_modelled_as_well_as_is_known_to_be_possible(predicted, at_most_deg):
    straight = [recording for recording in RECORDINGS if recording.bend == 0]
    _, rest = left_of_the_rest(straight, predicted)[0]
    assert np.rad2deg(rest) <= at_most_deg


@where_they_are_at_hand
@pytest.mark.parametrize('model', MODELS)
def test_a_model_explains_most_of_the_rest_of_the_most_bent_tube(model):
    found = left_of_the_rest(RECORDINGS[-1:], hysteresis_model(model, 0))
    for _, rest in found.values():
        assert np.rad2deg(rest) < 3.0


def test_a_sum_of_plays_is_found_again():
    driver = 1.5 * np.sin(np.arange(0.0, 9.0, 0.02))
    state, actual = 0.0, []
    for angle in driver:
        state = min(max(state, angle - 0.45), angle + 0.45)
        actual.append(0.1 * angle + 0.7 * state + 0.02)
    recording = HysteresisRecording(driver, np.array(actual))
    np.testing.assert_allclose(fitted(recording, driver), actual, atol=0.002)

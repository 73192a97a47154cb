import numpy as np
import pytest
from outside_data import REAL, needs

from endoscope_core.hysteresis import PlayParameters, forward
from endoscope_core.hysteresis.inverse import MODELS
from endoscope_core.identification import fit_model
from endoscope_lab.papers.real_recordings import (
    closed_cycle,
    models_on_real_recordings,
    real_recordings,
)

RECORDINGS = real_recordings()
where_they_are_at_hand = needs(REAL)


@where_they_are_at_hand
@pytest.mark.parametrize(
    ('model', 'at_most_deg'), [('play', 1.34), ('bouc_wen', 1.02), ('prandtl_ishlinskii', 1.01)]
)
def test_the_straight_tube_is_modelled_as_well_as_is_known_to_be_possible(model, at_most_deg):
    straight = [recording for recording in RECORDINGS if recording.bend == 0]
    _, second = models_on_real_recordings(straight, model, 0)[0]
    assert np.rad2deg(second) <= at_most_deg


@where_they_are_at_hand
def test_every_model_explains_most_of_the_second_cycle_of_the_most_bent_tube():
    for model in MODELS:
        for bend, (_, second) in models_on_real_recordings(RECORDINGS[-1:], model, 0).items():
            assert np.rad2deg(second) < 3.0, (model, bend)


def test_a_closed_cycle_says_that_loops_close():
    truth = PlayParameters(0.85, 0.5, 0.55, -0.04)
    driver = np.sin(np.arange(0.0, 2.0 * np.pi, 0.02))
    actual = forward(truth, np.tile(driver, 2))[: driver.size]
    recording = closed_cycle(driver, actual)
    assert recording.scored.sum() < recording.driver.size
    assert recording.scored[: driver.size].all()
    fit = fit_model([recording], 0, 'play')
    np.testing.assert_allclose(fit.predict(np.tile(driver, 2))[: driver.size], actual, atol=0.003)

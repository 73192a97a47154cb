import numpy as np
import pytest

from endoscope_explain.compare.black_boxes import (
    KINDS,
    PLAY_WIDTHS,
    motion_features,
    trained,
    training,
)
from endoscope_explain.compare.ladder import ladders
from endoscope_explain.fit.evidence import fitted_at, judged_at


@pytest.mark.parametrize('kind', list(KINDS))
def test_a_black_box_learns_a_smooth_function_of_several_outputs(kind):
    rng = np.random.default_rng(2)
    x = rng.uniform(-2.0, 2.0, (400, 3))
    y = np.stack([np.sin(x[:, 0]), 5.0 + x[:, 1] ** 2], axis=1)
    with training():
        predict = trained(kind, x[:300], y[:300] + 0.01 * rng.standard_normal((300, 2)))
    error = predict(x[300:]) - y[300:]
    assert np.sqrt(np.mean(error**2, axis=0)) == pytest.approx([0.0, 0.0], abs=0.25)


def test_features_remember_where_the_motion_came_from():
    time = 0.01 * np.arange(1000)
    angle = np.sin(0.5 * np.pi * time)[:, None]
    up, down = motion_features(time, angle, np.array([4.4, 5.6]))
    assert up[0] == pytest.approx(down[0], abs=1e-6)
    assert down[2] - up[2] == pytest.approx(PLAY_WIDTHS[0], abs=1e-6)


def test_what_is_judged_was_not_fitted_at():
    time = 0.01 * np.arange(4000)
    assert not (judged_at(time) & fitted_at(time)).any()
    assert judged_at(time).mean() == pytest.approx(0.25)
    gaps = np.abs(time[judged_at(time)][:, None] - time[fitted_at(time)][None, ::7])
    assert gaps.min() > 0.15


def test_physics_beats_black_boxes_on_a_second_recording(stribeck_case, record):
    explanation = stribeck_case.explanation
    second = record(explanation.augmented, duration=8.0, seed=9)
    held_out, validation = ladders(stribeck_case.recording, explanation, second, True, jobs=1)
    wire = 'wires/measured_js:wire_x_pos'
    for ladder in (held_out, validation):
        assert set(ladder) == {
            'nominal',
            'refitted',
            'augmented',
            'gaussian_process',
            'neural_network',
        }
        assert ladder['augmented'][wire].ratio < 1.5
        assert ladder['gaussian_process'][wire].ratio > ladder['augmented'][wire].ratio
    assert validation['neural_network'][wire].ratio > validation['augmented'][wire].ratio

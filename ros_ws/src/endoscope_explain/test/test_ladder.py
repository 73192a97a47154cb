import numpy as np
import pytest

from endoscope_explain.compare import ladders
from endoscope_explain.fit.evidence import fitted_at, judged_at


def test_what_is_judged_was_not_fitted_at():
    time = 0.01 * np.arange(4000)
    assert not (judged_at(time) & fitted_at(time)).any()
    assert judged_at(time).mean() == pytest.approx(0.25)
    gaps = np.abs(time[judged_at(time)][:, None] - time[fitted_at(time)][None, ::7])
    assert gaps.min() > 0.15


def test_plants_are_judged_on_a_second_recording(stribeck_case, record):
    explanation = stribeck_case.explanation
    second = record(explanation.augmented, duration=8.0, seed=9)
    for ladder in ladders(explanation, second):
        assert set(ladder) == {'nominal', 'refitted', 'augmented'}
        left = {name: fits['wires/measured_js:wire_x_pos'].ratio for name, fits in ladder.items()}
        assert left['augmented'] < 1.5 < left['refitted']

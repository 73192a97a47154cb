"""The numbers by which explanations are judged, from cases whose truth is known."""

import numpy as np
import pytest

from endoscope_benchmarks.concealed.criteria import (
    Bank,
    conformal,
    derived,
    sensitivity,
    source,
)
from endoscope_benchmarks.concealed.limits import SHARES
from endoscope_benchmarks.concealed.strata import as_strong

RNG = np.random.default_rng(1)


def test_a_conformal_limit_holds_the_next_score_as_often_as_it_says():
    held = [
        np.mean(RNG.normal(size=400) <= conformal(RNG.normal(size=39), 0.9)) for _ in range(400)
    ]
    assert np.mean(held) == pytest.approx(0.9, abs=0.01)


def test_too_few_cases_for_a_limit_are_refused():
    with pytest.raises(ValueError, match=r'5 scores are too few for a chance of 0\.9'):
        conformal(np.arange(5.0), 0.9)


@pytest.fixture(scope='module')
def bank():
    truth = np.where(RNG.uniform(size=100) < 0.97, 1.0, RNG.uniform(size=100))
    sizes = [np.array([1.0, 0.6, 0.2])] * 100
    beyond = np.concatenate([RNG.uniform(0.5, 1.2, size=100), np.full(20, 9.0)])
    return Bank(truth, sizes, beyond, beyond < 2.0, np.abs(RNG.normal(size=500)) / 1.645)


def test_criteria_follow_from_the_cases(bank):
    found = derived(bank)
    assert found.LEAST_SHARE == 1.0, 'nine in ten truths gain most'
    assert pytest.approx(1.0, abs=0.1) == found.REACH, 'intervals are as wide as they should be'
    assert 1.0 < found.BEYOND_FORM < 1.2


def test_the_module_holds_the_criteria_and_half_of_them_is_shown_to_be_worse(bank):
    found = derived(bank)
    names: dict[str, float] = {}
    exec(source(found, 'a test'), names)
    for name, value in vars(found).items():
        assert names[name] == pytest.approx(value, rel=0.01)
    reach = next(line for line in sensitivity(bank, found).splitlines() if 'REACH' in line)
    assert ': 90%' in reach


def test_an_effect_is_as_strong_as_asked_on_the_same_rig():
    strong, weak = (as_strong('gear_backlash', 3, share) for share in SHARES[:2])
    assert strong.moved == pytest.approx(SHARES[0], rel=0.06)
    assert weak.moved == pytest.approx(SHARES[1], rel=0.06)
    assert strong.bare == weak.bare

"""The numbers by which explanations are judged, from cases whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_explain.decide.decision import probability
from endoscope_lab.concealed.criteria import (
    Bank,
    conformal,
    derived,
    reliability,
    sensitivity,
    source,
)
from endoscope_lab.concealed.strata import as_strong

RNG = np.random.default_rng(1)
WEIGHTS = (-1.0, 4.0, 0.0)


def test_too_few_cases_for_a_limit_are_refused():
    with pytest.raises(ValueError, match=r'5 scores are too few for a chance of 0\.9'):
        conformal(np.arange(5.0), 0.9)


@pytest.fixture(scope='module')
def bank():
    beyond = np.concatenate([RNG.uniform(0.5, 1.2, size=100), np.full(20, 9.0)])
    alone = RNG.uniform(size=2000)
    named = np.column_stack([np.ones(2000), alone, np.zeros(2000)])
    return Bank(
        beyond,
        beyond < 2.0,
        np.abs(RNG.normal(size=500)) / 1.645,
        named,
        RNG.uniform(size=2000) < probability(named, WEIGHTS),
        np.arange(2000),
    )


def test_criteria_follow_from_the_cases(bank):
    found = derived(bank)
    assert pytest.approx(1.0, abs=0.1) == found.INTERVAL_WIDTH, (
        'intervals are as wide as they should be'
    )
    assert 1.0 < found.BEYOND_FORM < 1.2
    assert found.CERTAINTY[:2] == pytest.approx(WEIGHTS[:2], abs=0.4)


def test_names_are_right_as_often_as_their_probability_says(bank):
    lines = [line.split() for line in reliability(bank).splitlines()[1:-1]]
    assert len(lines) >= 5
    for *_, count, mean, right in lines:
        scatter = 3.0 * np.sqrt(float(mean) * (1.0 - float(mean)) / int(count))
        assert float(right) == pytest.approx(float(mean), abs=scatter + 0.02)


def test_a_name_that_was_always_right_is_not_certain(bank):
    sure = derived(replace(bank, named=np.ones((28, 3)), right=np.ones(28, bool)))
    (mean,) = probability([[1.0, 1.0, 1.0]], sure.CERTAINTY)
    # The mean odds of a share that was 28 of 28 lie beyond 29 to 1 (Laplace's rule).
    assert 29.0 / 30.0 < mean < 1.0 - 1e-6


def test_the_module_holds_the_criteria_and_half_of_them_is_shown_to_be_worse(bank):
    found = derived(bank)
    names: dict[str, float] = {}
    exec(source(found, 'a test'), names)
    for name, value in vars(found).items():
        assert names[name] == pytest.approx(value, rel=0.01, abs=1e-12)
    reach = next(line for line in sensitivity(bank, found).splitlines() if 'INTERVAL_WIDTH' in line)
    assert ': 90%' in reach


def test_an_effect_is_as_strong_as_asked_on_the_same_rig():
    strong, weak = (as_strong('gear_backlash', 3, (share, share)) for share in (0.1, 0.032))
    assert strong.moved == pytest.approx(0.1, rel=0.06)
    assert weak.moved == pytest.approx(0.032, rel=0.06)
    assert strong.bare == weak.bare

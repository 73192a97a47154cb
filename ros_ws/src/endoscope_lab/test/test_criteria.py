"""The numbers by which explanations are judged, from cases with known truth."""

from dataclasses import replace

import numpy as np
import pytest

from endoscope_explain.prediction_set import Contest
from endoscope_lab.concealed.derivation import (
    Bank,
    conformal,
    derived,
    reliability,
    sensitivity,
    source,
)
from endoscope_lab.concealed.sets import JudgedContest
from endoscope_lab.concealed.strata import as_strong

RNG = np.random.default_rng(1)
TEMPERATURE = 30.0
"""Of the evidence of the names below."""


def test_too_few_cases_for_a_limit_are_refused():
    with pytest.raises(ValueError, match=r'5 scores are too few for a chance of 0\.9'):
        conformal(np.arange(5.0), 0.9)


def drawn():
    """A contest of two names whose truth is as likely as evidence at a temperature makes it."""
    gains = np.sort(RNG.uniform(0.0, 150.0, size=2))[::-1]
    share = 1.0 / (1.0 + np.exp((gains[1] - gains[0]) / TEMPERATURE))
    first = bool(RNG.uniform() < share)
    left = float(RNG.choice([0.0, 0.9]))
    tried = Contest((('gravity',), ('contact',)), tuple(gains), 10.0, found=True, beyond_form=left)
    return JudgedContest(tried, 'bend_x', 'gravity', (first, not first, False, False))


@pytest.fixture(scope='module')
def bank():
    beyond = np.concatenate([RNG.uniform(0.5, 1.2, size=100), np.full(20, 9.0)])
    return Bank(
        beyond,
        beyond < 2.0,
        np.abs(RNG.normal(size=500)) / 1.645,
        tuple(drawn() for _ in range(300)),
        np.arange(300),
    )


@pytest.fixture(scope='module')
def found(bank):
    return derived(bank)


def test_criteria_follow_from_the_cases(bank, found):
    assert pytest.approx(1.0, abs=0.1) == found.INTERVAL_WIDTH, (
        'intervals are as wide as they should be'
    )
    assert 1.0 < found.BEYOND_FORM < 1.2
    near = Contest((('a',), ('b',)), (100.0, 100.0 - TEMPERATURE), 10.0, found=True)
    one, other, *rest = near.probabilities(found.POSTERIOR)
    assert np.log(one / other) == pytest.approx(1.0, abs=0.4)
    assert max(rest) < 0.01


def test_sets_of_new_cases_contain_the_truth_at_their_nominal_rate(found):
    held = []
    for each in (drawn() for _ in range(1000)):
        chances = each.contest.probabilities(found.POSTERIOR)
        right = np.max(chances[np.array(each.right)])
        held.append(each.reported_is_right or np.sum(chances[chances > right]) <= found.MASS)
    assert 0.85 < np.mean(held) < 0.97


def test_names_are_right_as_often_as_their_probability_states(bank):
    lines = [line.split() for line in reliability(bank).splitlines()[1:-1]]
    assert len(lines) >= 4
    for *_, count, mean, right in lines:
        scatter = 3.0 * np.sqrt(float(mean) * (1.0 - float(mean)) / int(count))
        assert float(right) == pytest.approx(float(mean), abs=scatter + 0.05)


def test_a_name_that_was_always_right_is_not_certain(bank):
    always = [replace(each, right=(True, False, False, False)) for each in bank.contests[:28]]
    sure = derived(replace(bank, contests=tuple(always * 4), case=np.arange(112)))
    (one, *_) = Contest((('gravity',),), (100.0,), 10.0, found=True).probabilities(sure.POSTERIOR)
    assert 0.99 < one < 1.0 - 1e-9


def test_the_module_holds_the_criteria_and_half_of_them_is_shown_to_be_worse(bank, found):
    names: dict[str, float] = {}
    exec(source(found, 'a test'), names)
    for name, value in vars(found).items():
        assert names[name] == pytest.approx(value, rel=0.01, abs=1e-2)
    reach = next(line for line in sensitivity(bank, found).splitlines() if 'INTERVAL_WIDTH' in line)
    assert ': 90%' in reach


def test_a_case_as_a_row_keeps_it_is_the_same_case(bank):
    assert all(JudgedContest.of_row(each.kept()) == each for each in bank.contests[:5])


def test_an_effect_is_as_strong_as_asked_on_the_same_rig():
    strong, weak = (as_strong('gear_backlash', 3, (share, share)) for share in (0.1, 0.032))
    assert strong.moved == pytest.approx(0.1, rel=0.06)
    assert weak.moved == pytest.approx(0.032, rel=0.06)
    assert strong.bare == weak.bare

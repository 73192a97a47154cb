"""Deciding numbers of the audit follow from recordings in which no mistake was made."""

import math

import numpy as np
import pytest

from endoscope_explain.audit.criteria import DERIVED
from endoscope_lab.mistakes.deriving import Seen, derived, source, without_worth


def test_criteria_are_quantiles_and_written_as_they_are():
    rng = np.random.default_rng(1)
    rows = [
        {q: Seen(rng.normal(1.0, 0.1, 2), rng.uniform(size=2), rng.uniform(size=2))}
        for _ in range(300)
        for q in ['all']
    ]
    rows = [dict.fromkeys(DERIVED.scales, row['all']) for row in rows]
    criteria = without_worth(rows)
    assert criteria.usual['bending'] == pytest.approx(0.5, abs=0.05)
    assert criteria.follows == pytest.approx(0.9, abs=0.05)
    low, high = criteria.scales['tension']
    assert (low, high) == pytest.approx((1.0 - 0.164, 1.0 + 0.164), abs=0.03)
    worths = [math.inf] * 398 + [3.0, 2.0]
    whole = derived(criteria, worths)
    assert whole.worth == 3.0
    module: dict[str, object] = {}
    exec(source(whole, 'a test'), module)
    assert module['DERIVED'] == whole


def test_too_few_recordings_derive_nothing():
    with pytest.raises(ValueError, match='too few'):
        derived(DERIVED, [1.0] * 50)

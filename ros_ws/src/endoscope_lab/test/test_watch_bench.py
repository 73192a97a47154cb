"""Thresholds of the watch: as many false alarms as they are derived for."""

import numpy as np

from endoscope_core.monitoring import Part
from endoscope_lab.watch.changing_rig import SEGMENT_S, Watched
from endoscope_lab.watch.trial import derived

RNG = np.random.default_rng(5)
SCALE = 12.0


def nominal(count, drawn):
    return [
        Watched('', seed, 60.0, np.nan, '', (), dict.fromkeys(map(str, Part), drawn()))
        for seed in range(count)
    ]


def thresholds(rows):
    found = {}
    exec(derived(rows), found)
    return found['THRESHOLDS']


def test_a_threshold_is_passed_as_often_as_it_may_be():
    # However gains are distributed below their exponential tail.
    found = [
        thresholds(nominal(120, lambda: max(RNG.exponential(SCALE), RNG.uniform(0.0, SCALE))))
        for _ in range(60)
    ]
    assert found[0].keys() == set(map(str, Part))
    passed = np.mean([np.exp(-each['tracker'] / SCALE) for each in found])
    # Each of six parts once in 60 h.
    assert 0.5 < passed / (SEGMENT_S / (60.0 * 3600.0)) < 2.0


def test_the_largest_gain_that_was_seen_raises_no_alarm_and_no_gain_needs_the_least():
    gains = iter([300.0] + [1.0] * 99)
    assert thresholds(nominal(100, lambda: next(gains)))['joint'] > 300.0
    # Odds of one in 60 h by Ville's inequality.
    assert thresholds(nominal(100, lambda: 0.0))['wire'] == float(f'{np.log(360.0):.3g}')

from itertools import pairwise

from endoscope_nodes.runtime.ticker import SampleClock

MS = 1_000_000


def test_a_slower_sensor_samples_at_its_rate_whatever_the_start():
    for start in (0, 7 * MS, 123_456_789 * MS):
        clock = SampleClock(40.0)
        due = [k for k in range(1000) if clock.due(start + k * MS)]
        steps = {b - a for a, b in pairwise(due[1:])}
        assert steps == {25}


def test_a_rate_that_does_not_divide_is_kept_on_average():
    clock = SampleClock(60.0)
    assert 59 <= sum(clock.due(k * MS) for k in range(1000)) <= 61


def test_a_missed_tick_does_not_lose_a_sample():
    clock = SampleClock(40.0)
    assert clock.due(0)
    assert clock.due(27 * MS)
    assert not clock.due(28 * MS)

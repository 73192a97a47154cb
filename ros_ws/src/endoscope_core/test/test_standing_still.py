"""Motors that are told to move and do not."""

import math

from endoscope_core.safety import StandingStill

MS = 1_000_000
NAMES = ('motor_x', 'motor_y')


def watched(goal, shaft, turns=100, every_ms=40, resolution=0.0015):
    """Turn at which a goal and a shaft (each of a time in s) are told of; None for never."""
    watch = StandingStill(NAMES, resolution)
    for k in range(turns):
        t = k * every_ms * 1e-3
        said = watch.look(goal(t), shaft(t), k * every_ms * MS)
        if said:
            return t, said
    return None


def test_a_motor_that_does_not_turn_is_named_within_a_third_of_a_second():
    t, said = watched(lambda t: (0.0, min(0.5, t)), lambda t: (0.0, 0.0))
    assert 0.3 <= t <= 0.4
    assert said.startswith('motor_y stands still')


def test_a_motor_that_follows_late_is_not():
    def goal(t):
        return 0.5 * math.sin(t), 0.02 * math.sin(9.0 * t)

    assert watched(goal, lambda t: goal(max(0.0, t - 0.2))) is None


def test_nor_one_that_creeps_nor_one_that_rests_beside_its_goal():
    assert watched(lambda t: (0.01 * t, 0.3), lambda t: (0.01 * t - 0.05, 0.25)) is None


def test_one_that_trembles_by_its_encoders_counts_is_and_by_more_is_not():
    def trembles(t):
        return 0.0, 0.004 * (round(25 * t) % 2)

    assert watched(lambda t: (0.0, t), trembles) is None
    assert watched(lambda t: (0.0, t), trembles, resolution=0.003) is not None


def test_one_that_stops_on_its_way_is():
    t, _ = watched(lambda t: (0.2 * t, 0.0), lambda t: (min(0.2, 0.2 * t), 0.0))
    assert 1.3 <= t <= 1.6


def test_without_a_measurement_nothing_is_said():
    assert watched(lambda t: (t, t), lambda t: None) is None

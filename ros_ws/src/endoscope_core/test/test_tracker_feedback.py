"""No correction moves of its own accord, whatever the tracker does."""

import math

import numpy as np
import pytest

from endoscope_core.control import (
    AdaptiveBacklashController,
    TrackerMeasurement,
)
from endoscope_core.control.limits import SHARE_OF_TRAVEL

TICK = 1e-3
PERIOD = 25


class Drive:
    """A controller on a play with gain behind a servo, driven tick by tick."""

    def __init__(self, half_gap=0.4):
        self.controller = AdaptiveBacklashController(1)
        self.controller.activate()
        self.half_gap = half_gap
        self.motor = self.joint = 0.0
        self.tick = 0

    def run(self, seconds, angle_at, tracker=True):
        """Desired angles and corrections (N,)."""
        desired, corrections = [], []
        for _ in range(round(seconds / TICK)):
            time = self.tick * TICK
            angle = angle_at(time)
            speed = (angle_at(time + TICK) - angle) / TICK
            heard = tracker and self.tick % PERIOD == 0
            measurement = TrackerMeasurement(time, [self.joint]) if heard else None
            correction = self.controller.step(time, [angle], [speed], measurement)[0]
            self.motor += (angle + correction - self.motor) * TICK / 0.03
            reach = 0.9 * self.motor
            self.joint = min(max(self.joint, reach - self.half_gap), reach + self.half_gap)
            desired.append(angle)
            corrections.append(correction)
            self.tick += 1
        return np.array(desired), np.array(corrections)


@pytest.fixture
def at_rest():
    """A controller that has learnt and now rests; what it corrects."""
    drive = Drive()
    drive.run(10.0, math.sin)
    stop = 10.0
    _, corrections = drive.run(1.0, lambda _: math.sin(stop))
    assert abs(corrections[-1]) > 0.1
    return drive, math.sin(stop), corrections[-1]


@pytest.mark.parametrize('tracker', [True, False])
def test_at_rest_the_correction_stays_with_and_without_tracker(at_rest, tracker):
    drive, angle, before = at_rest
    _, corrections = drive.run(5.0, lambda _: angle, tracker)
    assert np.all(corrections == before)


def test_at_rest_it_stays_when_measurements_return_or_say_something_else(at_rest):
    drive, angle, before = at_rest
    drive.run(2.0, lambda _: angle, tracker=False)
    drive.joint += 0.5
    drive.half_gap = 9.0
    _, corrections = drive.run(2.0, lambda _: angle)
    assert np.all(corrections == before)


def test_at_rest_it_stays_when_it_is_switched_off_and_on_and_forgets(at_rest):
    drive, angle, before = at_rest
    for change in (
        drive.controller.deactivate,
        drive.controller.forget,
        drive.controller.activate,
    ):
        change()
        _, corrections = drive.run(1.0, lambda _: angle)
        assert np.all(corrections == before)


def test_a_tracker_that_was_gone_moves_the_correction_no_faster_than_stated():
    drive = Drive()
    drive.run(10.0, math.sin)
    learnt = drive.controller.learnt
    start = math.sin(10.0)

    # One way only, so that the law itself has no reason to turn.
    way = -1.0 if math.cos(10.0) < 0.0 else 1.0

    def on(time):
        return start + way * 0.25 * (time - 10.0)

    _, gone = drive.run(1.5, on, tracker=False)
    assert drive.controller.learnt == learnt
    assert drive.controller.weight < 1.0
    _, back = drive.run(1.5, on)
    corrections = np.concatenate([gone, back])
    step = np.abs(np.diff(corrections))
    gain = max(abs(g) for g, _ in (*learnt, *drive.controller.learnt))
    own = (gain + 2.0 * SHARE_OF_TRAVEL) * 0.25 * TICK
    # The direction's memory may still be turning within the first few degrees.
    assert np.max(step[400:]) <= own


def test_the_first_measurement_after_a_gap_teaches_nothing():
    drive = Drive()
    drive.run(10.0, math.sin)
    drive.run(1.0, math.sin, tracker=False)
    learnt = drive.controller.learnt
    drive.joint += 0.3
    drive.tick += -drive.tick % PERIOD
    drive.run(TICK, math.sin)
    assert drive.controller.learnt == learnt


@pytest.mark.parametrize('tracker', [True, False])
def test_switched_off_or_without_tracker_it_fades_to_nothing_and_comes_back_without_a_jump(tracker):
    drive = Drive()
    _, learning = drive.run(14.0, math.sin)
    if tracker:
        drive.controller.deactivate()
    _, fading = drive.run(1.7, math.sin, tracker)
    assert fading[-1] == 0.0
    assert drive.controller.weight == 0.0
    assert drive.controller.tracker_fresh(15.7) == tracker
    drive.controller.activate()
    _, returning = drive.run(3.0, math.sin)
    assert np.max(np.abs(returning)) > 0.2
    joined = np.concatenate([learning[-1:], fading, returning])
    assert np.max(np.abs(np.diff(joined))) < 0.04

"""No correction moves of its own accord, whatever the tracker does."""

import math

import numpy as np
import pytest
from driven_play import PERIOD, TICK, DrivenPlay

from endoscope_core.control.limits import SHARE_OF_TRAVEL


@pytest.fixture
def at_rest():
    """A controller that has learnt and now rests; what it corrects."""
    drive = DrivenPlay()
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
    for change in (drive.controller.deactivate, drive.controller.forget, drive.controller.activate):
        change()
        _, corrections = drive.run(1.0, lambda _: angle)
        assert np.all(corrections == before)


def test_a_tracker_that_was_gone_moves_the_correction_no_faster_than_stated():
    drive = DrivenPlay()
    drive.run(10.0, math.sin)
    learnt = drive.controller.learnt
    # One way only, so that the law itself has no reason to turn.
    way = math.copysign(0.25, math.cos(10.0))

    def on(time):
        return math.sin(10.0) + way * (time - 10.0)

    _, gone = drive.run(1.5, on, tracker=False)
    assert drive.controller.learnt == learnt
    assert drive.controller.weight < 1.0
    _, back = drive.run(1.5, on)
    step = np.abs(np.diff(np.concatenate([gone, back])))
    gain = max(abs(g) for g, _ in (*learnt, *drive.controller.learnt))
    # The direction's memory may still be turning within the first few degrees.
    assert np.max(step[400:]) <= (gain + 2.0 * SHARE_OF_TRAVEL) * 0.25 * TICK


def test_the_first_measurement_after_a_gap_teaches_nothing():
    drive = DrivenPlay()
    drive.run(10.0, math.sin)
    drive.run(1.0, math.sin, tracker=False)
    learnt = drive.controller.learnt
    drive.joint += 0.3
    drive.tick += -drive.tick % PERIOD
    drive.run(TICK, math.sin)
    assert drive.controller.learnt == learnt


@pytest.mark.parametrize('tracker', [True, False])
def test_switched_off_or_without_tracker_it_fades_to_nothing_and_comes_back_without_a_jump(tracker):
    drive = DrivenPlay()
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

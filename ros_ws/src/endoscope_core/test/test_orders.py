"""Orders to calibrate or to go home: what they command, and how they end, without ROS."""

from concurrent.futures import Future
from dataclasses import replace

import numpy as np
import pytest

from endoscope_core.calibration.calibration_run import CALIBRATE, HOME, OrderCode, OrderState
from endoscope_core.classifier.classification import (
    ClassificationResult,
    ClassifierError,
    UnseenTensionError,
)
from endoscope_core.judgement import Judgement
from endoscope_core.orders import Orders, Pose
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import BRIEF, calibration_motion

MS = 1_000_000
FOUND = Judgement(ClassificationResult(70, 0.9, {70: 0.9, 80: 0.1}))


class Bench:
    """Orders whose shafts follow, whose wires are read and whose tensions are judged as said."""

    def __init__(self, found=FOUND, rig=None):
        self.found, self.tension = found, (5.0, 0.0, 5.0, 0.0)
        self.orders = Orders(
            rig or shipped_rig(),
            calibration_motion(BRIEF),
            self.judged,
            return_speed=1.0,
            rest=0.1,
            remedy='go without',
        )
        self.now_ns, self.shafts, self.fed = 1_000 * MS, (0.2, 0.0), []

    def judged(self, tension):
        done = Future()
        if isinstance(self.found, Exception):
            done.set_exception(self.found)
        else:
            done.set_result(self.found)
        return done

    def begin(self, name, session='session-1', silent=''):
        return self.orders.begin(name, self.now_ns, session, Pose(self.shafts, None), silent)

    def go_on(self, silent=''):
        """Tick until the order has ended; how."""
        while True:
            self.now_ns += MS
            if self.tension is not None:
                self.orders.add_tension(self.now_ns, self.tension)
            ending = self.orders.doubted(silent)
            if ending is not None:
                return ending
            command = self.orders.command(self.now_ns, 1)
            self.fed.append(self.orders.feedback)
            if command is not None and self.shafts is not None:
                self.shafts = command.position
            ending = self.orders.ended(Pose(self.shafts, None))
            if ending is not None:
                return ending


def test_a_calibration_ends_with_what_was_judged():
    bench = Bench()
    assert bench.begin(CALIBRATE).state is OrderState.EXECUTING
    ending = bench.go_on()
    assert ending.judgement is FOUND
    assert bench.orders.last.startswith('class 70 deg')
    assert ending.log.endswith(', probability 0.900')
    assert ending.zeros == pytest.approx((5.0, 0.0, 5.0, 0.0))
    assert bench.orders.feedback.state is OrderState.SUCCEEDED
    assert (bench.orders.order, bench.orders.completed, bench.orders.aborted) == (None, 1, 0)
    phases = list(dict.fromkeys(feedback.phase for feedback in bench.fed))
    assert phases == ['returning', 'resting', 'moving', 'judging']
    assert np.all(np.diff([feedback.progress for feedback in bench.fed]) >= 0.0)


@pytest.mark.parametrize(
    ('found', 'code', 'words'),
    [
        (UnseenTensionError('like no tube'), OrderCode.UNKNOWN_TUBE, 'like no tube; zero of a'),
        (ClassifierError('no numbers'), OrderCode.NOT_JUDGED, 'aborted: no numbers'),
    ],
)
def test_tensions_that_cannot_be_judged_end_it_without_a_class(found, code, words):
    bench = Bench(found)
    bench.begin(CALIBRATE)
    ending = bench.go_on()
    assert (ending.judgement, ending.code) == (None, code)
    assert ending.words.startswith(words)
    unknown = code is OrderCode.UNKNOWN_TUBE
    assert (bench.orders.refused, bench.orders.aborted) == (unknown, not unknown)
    assert bench.orders.feedback.state is OrderState.ABORTED


def test_a_defect_of_the_judge_is_no_ending():
    bench = Bench(ZeroDivisionError())
    bench.begin(CALIBRATE)
    with pytest.raises(ZeroDivisionError):
        bench.go_on()


def test_tensions_that_do_not_come_abort_it():
    bench = Bench()
    bench.begin(CALIBRATE)
    bench.tension = None
    assert bench.go_on().words == 'aborted: the tensions of the last samples did not come'


def test_home_is_where_the_shafts_are_at_zero():
    bench = Bench()
    bench.begin(HOME)
    assert bench.go_on().words == 'home reached: motors at zero'
    assert bench.orders.completed == 0
    bench.begin(HOME)
    bench.shafts = None
    ending = bench.go_on()
    assert ending.words == 'home is not reached: nothing measured instead of 0'
    assert (ending.code, bench.orders.aborted) == (OrderCode.NOT_REACHED, 1)


@pytest.mark.parametrize(
    ('name', 'words'), [(CALIBRATE, 'aborted: silent'), (HOME, 'aborted while returning to zero: ')]
)
def test_a_stream_that_falls_silent_aborts_either_order(name, words):
    bench = Bench()
    bench.begin(name)
    ending = bench.go_on(silent='silent')
    assert ending.code is OrderCode.STREAM_SILENT
    assert ending.words.startswith(words)
    assert ending.log == 'aborted while returning to zero: silent'
    assert bench.orders.abort('again', OrderCode.SESSION_ENDED) is None


def test_a_wire_that_is_pulled_too_hard_aborts_it():
    bench = Bench()
    bench.begin(CALIBRATE)
    bench.tension = (500.0, 0.0, 0.0, 0.0)
    ending = bench.go_on()
    assert ending.code is OrderCode.TENSION_CEILING
    assert 'tension of wire_x_pos is 500.0 N' in ending.words


def test_an_order_that_cannot_go_well_is_rejected_with_its_code():
    bench = Bench()
    assert bench.begin(HOME, session='').code is OrderCode.NO_SESSION
    rejected = bench.begin(HOME, silent='motors are silent')
    assert (rejected.code, rejected.words) == (OrderCode.STREAM_SILENT, 'motors are silent')
    assert bench.orders.last == 'home: motors are silent'
    assert bench.orders.feedback.state is OrderState.WAITING
    bench.begin(HOME)
    busy = bench.begin(CALIBRATE)
    assert (busy.state, busy.code) == (OrderState.REJECTED, OrderCode.BUSY)
    assert busy.id > bench.orders.feedback.id > rejected.id
    rig = shipped_rig()
    narrow = Bench(rig=replace(rig, joints=replace(rig.joints, reach=1.0)))
    beyond = narrow.begin(CALIBRATE)
    assert beyond.code is OrderCode.BEYOND_REACH
    assert 'go without' in beyond.words
    assert narrow.begin(HOME).state is OrderState.EXECUTING

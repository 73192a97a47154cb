"""Where a master has the slave go, by a motion that is played or by a handle, without ROS."""

import numpy as np
import pytest

from endoscope_core.control.master_motion import MasterMotion
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange
from endoscope_core.signals.sampled_motion import SampledMotion

RIG = shipped_rig()
MS = 1_000_000
BOUND = RIG.joints.entry_step
RAMP = np.linspace(0.5, 0.8, 301)


class Master:
    """A master at the side of a slave that goes where it is told."""

    def __init__(self, pose=(0.0, 0.0)):
        self.pose, self.now_ns = pose, 1_000 * MS
        self.motion = MasterMotion(RIG, lambda: self.pose)

    def plays(self, hold=False):
        angle = np.stack([RAMP, np.full(len(RAMP), np.nan)], axis=1)
        self.motion.play(SampledMotion(angle, np.gradient(angle, 1e-3, axis=0)), 1.0, hold)
        return self

    def go_on(self, ticks, held=True, free=True, hand=None):
        """Tick; what was desired."""
        found = []
        for _ in range(ticks):
            self.now_ns += MS
            if hand is not None:
                self.motion.take_handle(self.now_ns, hand, self.now_ns)
            desired = self.motion.next(self.now_ns, self.now_ns, 1, held=held, free=free)
            if desired is not None:
                self.pose = desired.position
                found.append(desired.position)
        return np.array(found)


def test_a_motion_is_approached_from_the_measured_pose_and_held_at_its_end():
    master = Master((0.1, -0.2)).plays()
    way = master.go_on(2_000)
    assert way[0] == pytest.approx((0.1, -0.2), abs=1e-6)
    assert np.abs(np.diff(way, axis=0)).max() < BOUND
    assert way[-1] == pytest.approx((RAMP[-1], -0.2))
    source = master.motion.source
    assert source.finished
    assert source.progress == source.length == pytest.approx(len(RAMP) * 1e-3)


def test_it_goes_on_where_it_stood_still_but_not_before_the_last_stream_has_ended():
    master = Master().plays()
    master.go_on(1_100)
    before = master.motion.source.progress
    assert not len(master.go_on(10, free=False))
    assert not len(master.go_on(150))
    way = master.go_on(400)
    assert way[0] == pytest.approx(master.pose, abs=RAMP[-1] - RAMP[0])
    assert master.motion.source.progress > before


def test_it_waits_for_the_clutch_where_it_has_to():
    master = Master().plays(hold=True)
    assert not len(master.go_on(100, held=False))
    assert len(master.go_on(100)) == 100
    assert master.motion.moving
    assert not len(master.go_on(1, held=False))
    assert not master.motion.moving


def test_a_handle_is_followed_from_where_the_slave_is_while_the_clutch_is_held():
    master = Master((0.3, 0.0))
    master.motion.follow(2.0)
    assert not len(master.go_on(200, held=False, hand=(0.5, 0.5)))
    master.go_on(100, hand=(0.5, 0.5))
    assert master.pose == pytest.approx((0.3, 0.0), abs=1e-3)
    for k in range(300):
        master.go_on(1, hand=(0.5 + 1e-4 * k, 0.5))
    master.go_on(300, hand=(0.53, 0.5))
    assert master.pose == pytest.approx((0.36, 0.0), abs=5e-3)
    assert not len(master.go_on(1, held=False, hand=(0.53, 0.5)))
    assert not master.motion.handle.engaged


def test_a_handle_that_falls_silent_stands_and_is_taken_up_from_there():
    master = Master()
    master.motion.follow(1.0)
    master.go_on(100, hand=(0.0, 0.0))
    stood = master.go_on(300)
    assert np.ptp(stood, axis=0).max() < 1e-6
    way = master.go_on(200, hand=(0.7, 0.7))
    assert np.abs(way).max() < 1e-3


def test_a_handle_that_moves_and_is_not_followed_is_noticed_once():
    master = Master()
    master.go_on(50, hand=(0.0, 0.0))
    assert not master.motion.handle_moved()
    master.go_on(50, hand=(0.05, 0.0))
    assert master.motion.handle_moved()
    assert not master.motion.handle_moved()


def test_it_keeps_to_the_range_of_the_tube():
    master = Master().plays()
    master.motion.ranges = (BendingRange(-0.6, 0.6),) * 2
    way = master.go_on(2_000)
    assert way.max() == pytest.approx(0.6, abs=0.01)
    assert master.motion.cut.report().endswith('asked for')


@pytest.mark.parametrize('hold', [False, True])
def test_nothing_moves_without_a_source_or_a_measured_pose(hold):
    master = Master()
    assert not len(master.go_on(10))
    master.plays(hold).pose = None
    assert not len(master.go_on(10))
    master.pose = (0.0, 0.0)
    assert len(master.go_on(10)) == 10
    master.motion.leave()
    assert not len(master.go_on(10))

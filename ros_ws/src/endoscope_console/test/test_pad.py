from collections import deque
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from page_in_virtual_time import MS, NEUTRAL

from endoscope_console.teleop.pad import PadHandle

SPEEDS = ((0.5, 1.0), (0.25, 2.0))
LIMITS = (3.0, 3.0)


class Follower:
    """A master that follows 60 ms late, from 0.3 rad and to 1 rad either way."""

    def __init__(self, speeds=SPEEDS, scale=1.0):
        self.pad = PadHandle(2, speeds, LIMITS)
        self.scale = scale
        self.now = 0
        self.frame = None
        self.follows = True
        self.grip = self.seq = 0
        self.wanted = deque([None] * 60, maxlen=60)
        self.anchor, self.reference = (0.3, -0.3), None

    def beat(self, ms=1):
        for _ in range(ms):
            self.now += MS
            wanted = self.wanted[0] if self.follows else None
            angles = self.pad.follow(self.now, self.frame, wanted, self.scale)
            if self.frame is None:
                self.reference = None
                self.wanted.append(None)
                continue
            if self.reference is None:
                self.reference = angles
            moved = zip(self.anchor, angles, self.reference, strict=True)
            goals = (a + self.scale * (h - r) for a, h, r in moved)
            self.wanted.append(tuple(max(-1.0, min(1.0, goal)) for goal in goals))
        return angles

    def says(self, **hand):
        self.seq += 1
        self.frame = replace(NEUTRAL, pressed=True, grip=self.grip, seq=self.seq, **hand)

    def take_hold(self, **hand):
        self.grip += 1
        self.says(**hand)
        self.beat(70)

    def let_go(self):
        self.frame = None
        return self.beat()


def test_in_speed_mode_the_angles_run_by_deflection_and_speed():
    hand = Follower()
    hand.take_hold()
    start = hand.beat()
    hand.says(x=1.0, y=-0.5)
    x, y = hand.beat(400)
    assert x - start[0] == pytest.approx(0.5 * 0.4)
    assert y - start[1] == pytest.approx(-0.5 * 0.25 * 0.4)
    hand.says(x=-1.0, turbo=True)
    assert hand.beat(100)[0] - x == pytest.approx(-1.0 * 0.1)


def test_a_negative_speed_turns_the_way_round():
    hand = Follower(speeds=((-0.5, -1.0), (0.25, 2.0)))
    hand.take_hold()
    start = hand.beat()
    hand.says(x=1.0)
    assert hand.beat(100)[0] - start[0] == pytest.approx(-0.05)


@pytest.mark.parametrize('scale', [0.25, 1.0, 4.0])
@pytest.mark.parametrize('turbo', [False, True])
def test_it_does_not_wind_up_at_a_limit(scale, turbo):
    hand = Follower(scale=scale)
    hand.take_hold()
    hand.says(x=1.0, turbo=turbo)
    hand.beat(20_000)
    assert hand.wanted[0][0] == 1.0
    at_limit = hand.beat()
    assert hand.beat(1000) == at_limit
    hand.says(x=-1.0, turbo=turbo)
    hand.beat(300)
    assert hand.wanted[0][0] < 1.0


def test_it_waits_until_the_console_follows():
    hand = Follower()
    hand.follows = False
    hand.take_hold(x=1.0)
    start = hand.beat()
    assert hand.beat(500) == start
    hand.follows = True
    assert hand.beat(100)[0] > start[0]


@pytest.mark.parametrize('mode', [False, True])
def test_nothing_moves_without_a_grip_and_the_next_one_begins_there(mode):
    hand = Follower()
    hand.take_hold(position_mode=mode)
    hand.says(position_mode=mode, x=0.8, y=0.1)
    before = hand.beat(50)
    assert hand.let_go() == before
    assert hand.beat(500) == before
    hand.grip += 1
    # A page that goes on with its last drag, or a stick that was never let go of.
    hand.says(position_mode=mode, x=0.8, y=0.1)
    assert hand.beat() == before


def test_in_position_mode_the_angles_are_dragged_within_20_ms_in_even_steps():
    hand = Follower()
    hand.take_hold(position_mode=True)
    start = hand.beat()
    dragged = [0.01 * k for k in range(1, 11)]
    path = []
    for x in dragged:
        hand.says(position_mode=True, x=x, y=-x)
        path += [hand.beat() for _ in range(20)]
        assert path[-1] == pytest.approx((start[0] + x, start[1] - x))
    steps = [after[0] - before[0] for before, after in pairwise(path)]
    assert steps == pytest.approx([0.01 / 20] * len(steps))


def test_what_was_dragged_before_the_clutch_engaged_moves_nothing():
    hand = Follower()
    hand.take_hold(position_mode=True, x=0.7)
    start = hand.beat()
    hand.says(position_mode=True, x=0.75)
    assert hand.beat(20)[0] == pytest.approx(start[0] + 0.05)


@given(
    st.lists(
        st.tuples(
            st.integers(1, 45),
            st.floats(-1e6, 1e6),
            st.floats(-1.0, 1.0),
            st.sampled_from(['goes on', 'goes on', 'lets go', 'takes hold']),
        ),
        max_size=30,
    ),
    st.booleans(),
)
def test_whatever_a_page_sends_no_step_is_faster_than_the_limit(steps, mode):
    hand = Follower(speeds=((0.5, 1.0),) * 2)
    before = hand.beat()
    for ms, x, y, event in steps:
        if event == 'lets go':
            hand.frame = None
        elif event == 'takes hold' or hand.frame is None:
            hand.grip += 1
            hand.says(position_mode=mode, x=x, y=y)
        else:
            hand.says(position_mode=mode, x=x, y=y)
        for _ in range(ms):
            after = hand.beat()
            limit = LIMITS[0] if mode else 0.5
            assert all(abs(a - b) <= limit * 1.001e-3 for a, b in zip(after, before, strict=True))
            if hand.frame is None:
                assert after == before
            before = after


def test_a_beat_that_stood_still_makes_up_for_no_more_than_a_command_lives():
    hand = Follower()
    hand.take_hold(x=1.0)
    before = hand.beat()
    hand.now += 5_000 * MS
    assert hand.beat()[0] - before[0] == pytest.approx(0.5 * 0.1)


def test_speeds_and_limits_are_those_of_the_joints():
    with pytest.raises(ValueError, match='2 joints, 1 speeds and 2 limits'):
        PadHandle(2, SPEEDS[:1], LIMITS)

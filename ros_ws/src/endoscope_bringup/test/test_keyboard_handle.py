from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_bringup.teleop.keyboard_handle import (
    MOVES,
    REPEAT_NS,
    SPEEDS,
    KeyboardHandle,
    Request,
)

MS = 1_000_000
TURN = 10
SPEED = 0.3


@dataclass
class Hand:
    """Keys typed at a keyboard handle whose master follows at once."""

    handle: KeyboardHandle
    ms: int = 0
    follows: bool = True
    hindrance: str = ''

    def turn(self, *keys):
        self.ms += TURN
        self.last = self.handle.turn(
            self.ms * MS, keys, self.hindrance, self.handle.position if self.follows else None
        )
        return self.last

    def rest(self, ms):
        return [self.turn() for _ in range(ms // TURN)]

    def hold(self, key, ms, delay=400, period=30):
        """A key held for some time as a terminal sends it: when the clutch was first held."""
        began = self.ms
        self.turn(key)
        engaged, due = None, began + TURN + delay
        while self.ms < began + ms:
            repeats = self.ms + TURN >= due
            if repeats:
                due += period
            if self.turn(*([key] if repeats else [])).clutch and engaged is None:
                engaged = self.ms - began
        return engaged


def held(key):
    """A hand that holds a key, and moves."""
    hand = Hand(KeyboardHandle(2, SPEED))
    hand.hold(key, 800)
    return hand


@pytest.mark.parametrize(('delay', 'period'), [(250, 25), (400, 30), (500, 33), (660, 40)])
def test_a_held_key_moves_from_its_first_repeat_to_just_after_its_last(delay, period):
    hand = Hand(KeyboardHandle(2, SPEED))
    engaged = hand.hold('w', 2000, delay, period)
    assert delay <= engaged <= delay + 2 * TURN
    assert hand.last.position[0] == 0.0
    moved = hand.last.position[1]
    assert moved == pytest.approx(SPEED * (2.0 - 1e-3 * engaged), abs=SPEED * 0.05)
    turns = hand.rest(REPEAT_NS // MS + 2 * TURN)
    assert not turns[-1].clutch
    assert hand.handle.dead_man.reason == 'no sign of the operator'


def test_a_tap_moves_nothing():
    hand = Hand(KeyboardHandle(2, SPEED))
    for key in ('w', 'up', 'd'):
        hand.turn(key)
        assert not any(turn.clutch for turn in hand.rest(1000))


def test_text_that_is_pasted_moves_nothing():
    hand = Hand(KeyboardHandle(2, SPEED))
    assert not hand.turn(*'dddddddd').clutch
    for _ in range(20):
        assert not hand.turn('d', 'd').clutch


def test_repeats_that_were_held_up_on_their_way_begin_no_new_grip():
    hand = Hand(KeyboardHandle(2, SPEED))
    hand.hold('w', 800)
    assert hand.last.clutch
    hand.rest(300)
    for _ in range(20):
        assert not hand.turn('w').clutch
        assert not any(turn.clutch for turn in hand.rest(20))
    hand.rest(200)
    assert hand.hold('w', 800) is not None


@pytest.mark.parametrize('key', [' ', 'x', 'other', 'e', 'p', 'a', 'h'])
def test_any_other_key_stops_it_at_once_and_for_the_rest_of_the_hold(key):
    hand = held('d')
    assert hand.last.clutch
    assert not hand.turn(key).clutch
    for _ in range(20):
        assert not hand.turn('d').clutch
        hand.rest(20)


def test_a_repeat_that_does_not_come_in_time_is_a_key_let_go():
    hand = held('w')
    hand.turn('w')
    assert hand.rest(REPEAT_NS // MS)[-1].clutch
    assert not hand.turn().clutch
    assert not hand.turn('w').clutch, 'it has to be pressed again'


def test_a_hindrance_that_ends_while_the_key_is_held_moves_nothing():
    hand = Hand(KeyboardHandle(2, SPEED), hindrance='DISABLED')
    assert hand.hold('w', 800) is None
    hand.hindrance = ''
    for _ in range(20):
        assert not hand.turn('w').clutch
        hand.rest(20)


def test_the_hand_waits_until_the_master_follows():
    hand = Hand(KeyboardHandle(2, SPEED), follows=False)
    hand.hold('w', 800)
    assert hand.last.clutch
    assert hand.last.position == (0.0, 0.0)
    hand.follows = True
    hand.turn('w')
    assert hand.rest(100)[-1].position[1] > 0.0


def test_the_hand_waits_at_a_limit_and_turns_back_soon():
    handle, now = KeyboardHandle(2, SPEED), 0
    for ms in range(0, 2000, 200):
        # Each key for a second: the first repeat, and what follows.
        key = 'd' if ms < 1000 else 'a'
        for step in range(0, 200, TURN):
            now = ms + step
            repeats = (ms % 1000 == 0 and step == 0) or ms % 1000 >= 200
            turn = handle.turn(now * MS, [key] * repeats, wanted=(1.0, 0.0))
            if now == 990:
                assert turn.at_limit == (True, False)
                assert 0.05 < turn.position[0] < 0.08
    assert turn.clutch
    assert handle.position[0] < 0.0


def test_home_is_held_without_the_clutch():
    hand = held('h')
    assert hand.last.homing
    assert not hand.last.clutch
    assert not hand.rest(800)[-1].homing


def test_keys_that_ask_for_something_ask_once_however_long_they_are_held():
    hand = Hand(KeyboardHandle(2, SPEED))
    asked = [*hand.turn('e').requests]
    for _ in range(40):
        hand.rest(30)
        asked += hand.turn('e').requests
    assert asked == [Request.ENABLE]
    hand.rest(1000)
    assert hand.turn('e').requests == (Request.ENABLE,)
    asked = [hand.turn(key).requests for key in ('p', 'q', 'x')]
    assert asked == [(Request.PAUSE,), (Request.QUIT,), ()]


def test_speed_stays_within_its_bounds():
    hand = Hand(KeyboardHandle(2, SPEED))
    for key, bound in ((']', SPEEDS[1]), ('[', SPEEDS[0])):
        for _ in range(40):
            hand.turn(key)
        assert hand.handle.speed == bound


KEYS = st.sampled_from((*MOVES, 'h', ' ', 'e', '[', ']', 'other'))
TURNS = st.lists(
    st.tuples(
        st.sampled_from([1, 5, 10, 20, 40, 90, 150, 300]),
        st.one_of(st.just(['w']), st.lists(KEYS, max_size=3)),
        st.sampled_from(['', '', '', 'not enabled']),
        st.booleans(),
    ),
    max_size=80,
)


@given(TURNS)
def test_no_motion_without_a_fresh_sign_of_a_held_key_and_none_faster_than_set(turns):
    handle = KeyboardHandle(2, SPEED)
    now, heard, before = 0, None, (0.0, 0.0)
    handle.turn(0)
    for wait, keys, hindrance, follows in turns:
        now += wait
        if any(key in MOVES or key == 'h' for key in keys):
            heard = now
        speed = handle.speed
        turn = handle.turn(now * MS, keys, hindrance, before if follows else None)
        speed = max(speed, handle.speed)
        moved = max(abs(a - b) for a, b in zip(turn.position, before, strict=True))
        if turn.clutch or turn.homing:
            assert (now - heard) * MS <= REPEAT_NS
            assert not hindrance
            assert wait <= 100
        if moved:
            assert turn.clutch
        assert moved <= speed * wait * 1e-3 + 1e-12
        assert not (turn.clutch and turn.homing)
        before = turn.position

from dataclasses import dataclass

import pytest
from hypothesis import given
from hypothesis import strategies as st

from endoscope_bringup.teleop.keyboard_handle import (
    FIRST_REPEAT_NS,
    MOVES,
    REPEAT_NS,
    SPEEDS,
    KeyboardHandle,
    Request,
)
from endoscope_bringup.teleop.terminal import KeyEvent, KeyEventKind

PRESS, REPEAT, RELEASE = KeyEventKind
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

    def turn(self, *events):
        self.ms += TURN
        self.last = self.handle.turn(
            self.ms * MS,
            [KeyEvent(e) if isinstance(e, str) else e for e in events],
            self.hindrance,
            self.handle.position if self.follows else None,
        )
        return self.last

    def rest(self, ms):
        return [self.turn() for _ in range(ms // TURN)]

    def hold(self, key, ms, delay=400, period=30):
        """A key held for some time as a terminal tells it: when the clutch was first held."""
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


def guessing():
    return Hand(KeyboardHandle(2, SPEED))


def told():
    return Hand(KeyboardHandle(2, SPEED, told_apart=True))


@pytest.mark.parametrize(('delay', 'period'), [(250, 25), (400, 30), (500, 33), (660, 40)])
def test_a_held_key_moves_from_its_first_repeat_to_just_after_its_last(delay, period):
    hand = guessing()
    engaged = hand.hold('w', 2000, delay, period)
    assert delay <= engaged <= delay + 2 * TURN
    assert hand.last.position[0] == 0.0
    moved = hand.last.position[1]
    assert moved == pytest.approx(SPEED * (2.0 - 1e-3 * engaged), abs=SPEED * 0.05)
    turns = hand.rest(REPEAT_NS // MS + 2 * TURN)
    assert not turns[-1].clutch
    assert hand.handle.dead_man.reason == 'no sign of the operator'


def test_a_tap_moves_nothing():
    hand = guessing()
    for key in ('w', 'up', 'd'):
        hand.turn(key)
        assert not any(turn.clutch for turn in hand.rest(1000))


def test_text_that_is_pasted_moves_nothing():
    hand = guessing()
    assert not hand.turn(*'dddddddd').clutch
    for _ in range(20):
        assert not hand.turn('d', 'd').clutch


def test_repeats_that_were_held_up_on_their_way_begin_no_new_grip():
    hand = guessing()
    hand.hold('w', 800)
    assert hand.last.clutch
    hand.rest(300)
    for _ in range(20):
        assert not hand.turn('w').clutch
        assert not any(turn.clutch for turn in hand.rest(20))
    hand.rest(200)
    assert hand.hold('w', 800) is not None


@pytest.mark.parametrize('key', [' ', 'x', 'escape', 'tab', 'other', 'focus lost', 'e', 'p', '-'])
def test_any_other_key_stops_it_at_once_and_for_the_rest_of_the_hold(key):
    for hand, told_apart in ((guessing(), False), (told(), True)):
        if told_apart:
            assert hand.turn('d').clutch
        else:
            hand.hold('d', 800)
        assert hand.last.clutch
        assert not hand.turn(key).clutch
        for _ in range(20):
            assert not hand.turn(KeyEvent('d', REPEAT)).clutch
            hand.rest(20)


def test_press_and_release_are_obeyed_at_once_where_they_are_told():
    hand = told()
    assert hand.turn('right').clutch
    hand.rest(300)
    assert hand.last.clutch
    before = hand.last.position
    assert not hand.turn(KeyEvent('right', RELEASE)).clutch
    assert hand.rest(200)[-1].position == before


def test_two_keys_at_once_move_both_joints():
    hand = told()
    hand.turn('right')
    hand.turn('down')
    hand.rest(100)
    assert hand.last.position == pytest.approx((SPEED * 0.11, -SPEED * 0.11))
    hand.turn(KeyEvent('right', RELEASE))
    before = hand.last.position
    hand.rest(100)
    assert hand.last.position == pytest.approx((before[0], before[1] - SPEED * 0.1))


def test_a_release_that_never_comes_ends_by_silence_and_needs_a_new_press():
    hand = told()
    hand.turn('w')
    hand.turn(KeyEvent('w', REPEAT))
    assert hand.rest(REPEAT_NS // MS)[-1].clutch
    assert not hand.turn().clutch
    for _ in range(20):
        assert not hand.turn(KeyEvent('w', REPEAT)).clutch
    assert hand.turn('w').clutch
    assert not hand.rest(FIRST_REPEAT_NS // MS + TURN)[-1].clutch


def test_a_hindrance_that_ends_while_the_key_is_held_moves_nothing():
    for hand in (guessing(), told()):
        hand.hindrance = 'DISABLED'
        assert hand.hold('w', 800) is None
        hand.hindrance = ''
        for _ in range(20):
            assert not hand.turn(KeyEvent('w', REPEAT)).clutch
            hand.rest(20)


def test_the_hand_waits_until_the_master_follows():
    hand = told()
    hand.follows = False
    hand.turn('w')
    assert hand.rest(100)[-1].position == (0.0, 0.0)
    assert hand.last.clutch
    hand.follows = True
    assert hand.rest(100)[-1].position[1] > 0.0


def test_the_hand_waits_at_a_limit_and_turns_back_soon():
    handle, now = KeyboardHandle(2, SPEED, told_apart=True), 0
    handle.turn(0, [KeyEvent('d')], wanted=(1.0, 0.0))
    for _ in range(100):
        now += TURN
        turn = handle.turn(now * MS, [KeyEvent('d', REPEAT)], wanted=(1.0, 0.0))
    assert turn.at_limit == (True, False)
    assert 0.05 < turn.position[0] < 0.08
    now += TURN
    turn = handle.turn(now * MS, [KeyEvent('d', RELEASE), KeyEvent('a')], wanted=(1.0, 0.0))
    now += TURN
    assert handle.turn(now * MS, wanted=(1.0, 0.0)).at_limit == (False, False)


def test_home_is_held_without_the_clutch():
    for hand, told_apart in ((guessing(), False), (told(), True)):
        if told_apart:
            hand.turn('h')
        else:
            hand.hold('h', 800)
        assert hand.last.homing
        assert not hand.last.clutch
        assert not hand.rest(800)[-1].homing


def test_keys_that_ask_for_something_ask_once_however_long_they_are_held():
    hand = guessing()
    asked = [*hand.turn('e').requests]
    for _ in range(40):
        hand.rest(30)
        asked += hand.turn('e').requests
    assert asked == [Request.ENABLE]
    hand.rest(1000)
    assert hand.turn('e').requests == (Request.ENABLE,)
    keys = ('p', '-', '=', '+', 'q', 'ctrl+c', 'ctrl+z')
    assert [hand.turn(key).requests for key in keys] == [
        (Request.PAUSE,),
        (Request.SMALLER,),
        (Request.LARGER,),
        (Request.LARGER,),
        (Request.QUIT,),
        (Request.QUIT,),
        (Request.SUSPEND,),
    ]


def test_speed_stays_within_its_bounds():
    hand = guessing()
    for key, bound in ((']', SPEEDS[1]), ('[', SPEEDS[0])):
        for _ in range(40):
            hand.turn(key)
        assert hand.handle.speed == bound


KEYS = (*MOVES, 'h', ' ', 'e', '[', ']', 'focus lost')
EVENTS = st.builds(KeyEvent, st.sampled_from(KEYS), st.sampled_from([PRESS, REPEAT, RELEASE]))
TURNS = st.lists(
    st.tuples(
        st.sampled_from([1, 5, 10, 20, 40, 90, 150, 300]),
        st.lists(EVENTS, max_size=3),
        st.sampled_from(['', '', '', 'not enabled']),
        st.booleans(),
    ),
    max_size=80,
)


@given(st.booleans(), TURNS)
def test_no_motion_without_a_fresh_sign_of_a_held_key_and_none_faster_than_said(told_apart, turns):
    handle = KeyboardHandle(2, SPEED, told_apart)
    now, heard, before = 0, None, (0.0, 0.0)
    handle.turn(0)
    for wait, events, hindrance, follows in turns:
        now += wait
        if any(e.key in MOVES or e.key == 'h' for e in events):
            heard = now
        speed = max(handle.speed, SPEEDS[0])
        turn = handle.turn(now * MS, events, hindrance, before if follows else None)
        speed = max(speed, handle.speed)
        moved = max(abs(a - b) for a, b in zip(turn.position, before, strict=True))
        if turn.clutch or turn.homing:
            lasts = REPEAT_NS if not told_apart else FIRST_REPEAT_NS
            assert (now - heard) * MS <= lasts
            assert not hindrance
            assert wait <= 100
        if moved:
            assert turn.clutch
        assert moved <= speed * wait * 1e-3 + 1e-12
        assert not (turn.clutch and turn.homing)
        before = turn.position


@given(TURNS)
def test_after_a_repeat_silence_counts_sooner(turns):
    handle, now, heard = KeyboardHandle(2, SPEED, told_apart=True), 0, 0
    handle.turn(0, [KeyEvent('w')])
    for wait, _, _, _ in turns:
        now += wait
        if wait < 40:
            heard = now
            handle.turn(now * MS, [KeyEvent('w', REPEAT)])
        elif handle.turn(now * MS).clutch and heard:
            assert (now - heard) * MS <= REPEAT_NS

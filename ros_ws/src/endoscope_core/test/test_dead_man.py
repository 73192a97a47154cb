from hypothesis import given
from hypothesis import strategies as st

from endoscope_core.teleop import STALL_NS, DeadMan

MS = 1_000_000
LASTS = 150 * MS


def test_it_holds_from_a_grip_until_the_hand_lets_go():
    dead_man = DeadMan()
    assert not dead_man.turn(0)
    dead_man.hear(10 * MS, 1, LASTS)
    assert dead_man.turn(10 * MS)
    assert dead_man.reason == ''
    dead_man.hear(20 * MS, 0, LASTS)
    assert not dead_man.turn(20 * MS)
    assert dead_man.reason == 'let go'


def test_silence_lets_go_and_signs_of_the_same_grip_do_not_hold_again():
    dead_man = DeadMan()
    dead_man.hear(0, 1, LASTS)
    for now in range(0, 151, 10):
        assert dead_man.turn(now * MS)
    assert not dead_man.turn(160 * MS)
    assert dead_man.reason == 'no sign of the operator'
    dead_man.hear(165 * MS, 1, LASTS)
    assert not dead_man.turn(170 * MS)
    dead_man.hear(175 * MS, 2, LASTS)
    assert dead_man.turn(180 * MS)


def test_a_grip_begun_under_a_hindrance_never_holds():
    dead_man = DeadMan()
    dead_man.hear(0, 1, LASTS)
    assert not dead_man.turn(0, 'DISABLED')
    assert dead_man.reason == 'DISABLED'
    dead_man.hear(10 * MS, 1, LASTS)
    assert not dead_man.turn(10 * MS)
    dead_man.hear(20 * MS, 2, LASTS)
    assert dead_man.turn(20 * MS)


def test_a_loop_that_stood_still_lets_go():
    dead_man = DeadMan()
    dead_man.hear(0, 1, 10 * STALL_NS)
    assert dead_man.turn(0)
    assert not dead_man.turn(STALL_NS + 1)
    assert 'not run in time' in dead_man.reason


@given(
    st.lists(
        st.tuples(
            st.integers(0, 200),
            st.one_of(st.none(), st.integers(0, 5)),
            st.sampled_from(['', 'not enabled']),
        ),
        max_size=60,
    )
)
def test_whatever_comes_it_holds_only_by_a_fresh_sign_of_a_grip_that_never_ended(steps):
    dead_man, now, heard, ended, number = DeadMan(), 0, None, {0}, 0
    dead_man.turn(0)
    for wait, grip, hindrance in steps:
        now += wait * MS
        if grip is not None:
            if grip != number:
                ended.add(number)
            number, heard = grip, now
            dead_man.hear(now, grip, LASTS)
        held = dead_man.turn(now, hindrance)
        if held:
            assert now - heard <= LASTS
            assert number not in ended
            assert not hindrance
            assert wait * MS <= STALL_NS
        else:
            ended.add(number)
        assert held != bool(dead_man.reason)

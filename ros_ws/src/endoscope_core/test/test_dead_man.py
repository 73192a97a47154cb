from hypothesis import example, given
from hypothesis import strategies as st

from endoscope_core.teleop import LET_GO, SILENT, STALL_NS, STALLED, DeadMan

MS = 1_000_000
LASTS = 150 * MS


@given(
    st.lists(
        st.tuples(
            st.integers(0, 60) | st.integers(0, 200),
            st.one_of(st.none(), st.integers(0, 9)),
            st.sampled_from(['', '', 'not enabled']),
        ),
        max_size=60,
    )
)
@example([(10, 1, ''), (10, 1, ''), (10, 0, ''), (10, 1, ''), (10, 2, '')])
@example([(0, 1, ''), (75, None, ''), (75, None, ''), (1, None, ''), (5, 1, ''), (5, 2, '')])
@example([(0, 1, ''), (80, None, ''), (80, 1, '')])
@example([(0, 1, 'not enabled'), (10, 1, ''), (10, 2, '')])
@example([(0, 1, ''), (100, None, ''), (50, 1, ''), (101, 1, '')])
def test_it_holds_by_a_fresh_sign_of_a_grip_that_never_ended_and_says_what_ended_it(steps):
    dead_man, now, heard, spent, number = DeadMan(), 0, 0, 0, 0
    assert not dead_man.turn(0)
    for wait, grip, hindrance in steps:
        now += wait * MS
        was_held, silent = dead_man.held, now - heard > LASTS
        if grip is not None:
            if silent or grip != number:
                spent = max(spent, number)
            number, heard = grip, now
            dead_man.hear(now, grip, LASTS)
        if wait * MS > STALL_NS:
            ending = STALLED
        elif number <= spent:
            ending = SILENT if silent else LET_GO
        elif now - heard > LASTS:
            ending = SILENT
        else:
            ending = hindrance
        assert dead_man.turn(now, hindrance) == (not ending)
        if ending:
            spent = max(spent, number)
        assert bool(dead_man.reason) == bool(ending)
        assert dead_man.reason == ending or not was_held

from dataclasses import replace

import pytest
from page_in_virtual_time import MS, Page

from endoscope_console.teleop.frames import Source
from endoscope_console.teleop.operator import Conditions, DeadManState, OperatorDeadMan, Reason

OPEN, READY, ENGAGED = DeadManState


def of_conditions(**changes):
    def change(page):
        page.learns(**changes)

    return change


def goes_blind(page):
    page.draws = False
    page.go_on(400)


def was_not_run(page):
    for _ in range(6):
        page.now += 20 * MS
        page.send()


ENDS = {
    'the hand lets go': (Reason.RELEASED, lambda page: page.send(pressed=False)),
    'another grip': (Reason.RELEASED, lambda page: page.send(grip=page.hand.grip + 1)),
    'an older grip': (Reason.RELEASED, lambda page: page.send(grip=0)),
    'another source': (Reason.RELEASED, lambda page: page.send(source=Source.POINTER)),
    'another mode': (Reason.RELEASED, lambda page: page.send(position_mode=True)),
    'silence': (Reason.SILENT, lambda page: page.turn(100)),
    'a late frame': (Reason.LATE, lambda page: page.send(late_ns=101 * MS)),
    'a frame twice': (Reason.ORDER, lambda page: page.send(seq=page.hand.seq - 1)),
    'no frame': (Reason.MALFORMED, lambda page: page.dead_man.refuse(Reason.MALFORMED, 'c1')),
    'too many': (Reason.FLOOD, lambda page: page.dead_man.refuse(Reason.FLOOD, 'c1')),
    'a hidden page': (Reason.HIDDEN, lambda page: page.send(visible=False, pressed=False)),
    'another window': (Reason.UNFOCUSED, lambda page: page.send(focused=False)),
    'a closed page': (Reason.CLOSED, lambda page: page.dead_man.closed('c1')),
    'the lease given back': (Reason.LOST, of_conditions(holder='')),
    'the lease taken': (Reason.LOST, of_conditions(holder='c2')),
    'not enabled': (Reason.STATE, of_conditions(state_enabled=False)),
    'no supervisor': (Reason.STATE, of_conditions(state_age_ns=3501 * MS)),
    'another session': (Reason.STATE, of_conditions(session='session-2')),
    'calibration': (Reason.CALIBRATION, of_conditions(calibrating=True)),
    'another source of the master': (Reason.SOURCE, of_conditions(source='none')),
    'a played motion': (Reason.SOURCE, of_conditions(source='file', playing=True)),
    'old pictures': (Reason.BLIND, goes_blind),
    'a beat that stood still': (Reason.STALLED, was_not_run),
}


@pytest.mark.parametrize(('reason', 'happens'), ENDS.values(), ids=ENDS)
def test_each_ends_the_grip_with_its_reason_and_only_a_new_grip_holds(reason, happens):
    page = Page()
    page.engage()
    page.go_on(60)
    assert (page.dead_man.state, page.dead_man.reason) == (ENGAGED, None)
    held = page.hand
    happens(page)
    page.turn()
    assert (page.dead_man.state, page.dead_man.reason) == (OPEN, reason)
    assert page.dead_man.counts == {reason: 1}

    # What is still on its way from that grip means nothing, however fine all else is.
    page.learns(state_age_ns=0, **vars(Page().conditions))
    page.draws = True
    page.hand = replace(held, seq=page.hand.seq + 1)
    page.go_on(200)
    assert page.dead_man.state is OPEN
    assert page.dead_man.missing is Reason.HANDS_ON
    page.engage(grip=10)
    assert page.dead_man.counts.total() == 1


def test_a_gamepad_that_is_unplugged_is_told_from_a_hand_that_lets_go():
    page = Page()
    page.engage(source=Source.GAMEPAD)
    page.send(pressed=False, source=Source.KEYBOARD)
    assert page.dead_man.reason is Reason.UNPLUGGED
    page.engage(source=Source.GAMEPAD)
    page.send(pressed=False)
    assert page.dead_man.reason is Reason.RELEASED


def test_silence_ends_it_100_ms_after_the_last_arrival_and_not_before():
    page = Page()
    page.engage()
    page.send()
    page.turn(99)
    assert page.dead_man.engaged
    page.turn()
    assert page.dead_man.reason is Reason.SILENT


def test_a_gap_between_two_frames_ends_it_though_no_turn_saw_it():
    page = Page()
    page.engage()
    page.go_on(40)
    page.turn(30)
    page.now += 80 * MS
    page.send()
    page.turn()
    assert page.dead_man.reason is Reason.SILENT


@pytest.mark.parametrize(
    ('lacks', 'happens'),
    [
        (Reason.LOST, of_conditions(holder='')),
        (Reason.SILENT, of_conditions(holder='c2')),
        (Reason.HIDDEN, lambda page: page.send(visible=False)),
        (Reason.UNFOCUSED, lambda page: page.send(focused=False)),
        (Reason.STATE, of_conditions(state_enabled=False)),
        (Reason.STATE, of_conditions(state_age_ns=3501 * MS)),
        (Reason.CALIBRATION, of_conditions(calibrating=True)),
        (Reason.SOURCE, of_conditions(source='motion')),
        (Reason.BLIND, goes_blind),
    ],
)
def test_readiness_ends_with_what_it_rests_on_and_says_what_is_missing(lacks, happens):
    page = Page()
    page.let_go()
    assert page.dead_man.state is READY
    happens(page)
    page.turn(2)
    assert (page.dead_man.state, page.dead_man.missing) == (OPEN, lacks)
    page.take_hold()
    page.go_on(100)
    assert page.dead_man.state is OPEN
    assert not page.dead_man.counts


def test_hands_have_to_be_off_first():
    page = Page()
    page.hand = replace(page.hand, pressed=True, grip=1)
    page.go_on(100)
    assert page.dead_man.missing is Reason.HANDS_ON
    page.send(pressed=False, x=0.5)
    page.turn()
    assert page.dead_man.missing is Reason.HANDS_ON
    page.send(pressed=False, x=0.09, y=-0.09)
    page.turn()
    assert page.dead_man.state is READY


def test_a_late_grip_does_not_engage():
    page = Page()
    page.let_go()
    page.hand = replace(page.hand, pressed=True, grip=1)
    page.send(late_ns=150 * MS)
    page.turn()
    assert (page.dead_man.state, page.dead_man.reason) == (OPEN, Reason.LATE)
    page.go_on(100)
    assert page.dead_man.state is OPEN


def test_a_burst_of_a_grip_and_its_end_holds_nothing():
    page = Page()
    page.let_go()
    page.send(pressed=True, grip=1)
    page.send(pressed=False, grip=1)
    page.turn()
    assert page.dead_man.state is READY
    page.send(pressed=True, grip=1)
    page.turn()
    assert page.dead_man.state is OPEN


def test_a_burst_of_a_new_grip_and_one_that_has_ended_holds_nothing():
    page = Page()
    page.engage()
    page.let_go()
    page.send(pressed=True, grip=2)
    page.send(pressed=True, grip=1)
    page.turn()
    assert page.dead_man.state is OPEN
    page.send(pressed=True, grip=2)
    page.turn()
    assert page.dead_man.state is OPEN


def test_clocks_that_drift_apart_are_not_lateness():
    page = Page()
    page.engage()
    for k in range(1500):
        page.send(late_ns=k * 20 * MS // 2000)
        page.turn(20)
    assert page.dead_man.engaged


def test_a_slow_way_that_is_always_as_slow_is_not_lateness():
    page = Page()
    page.send(late_ns=250 * MS)
    page.hand = replace(page.hand, pressed=True, grip=1)
    page.turn()
    for _ in range(50):
        page.send(late_ns=250 * MS)
        page.turn(20)
    assert page.dead_man.engaged


def test_only_the_holder_of_the_lease_is_heard():
    page = Page()
    page.engage()
    for client in ('c2', ''):
        page.dead_man.hear(page.frame(pressed=False), page.now, client)
        page.dead_man.refuse(Reason.MALFORMED, client)
        page.dead_man.closed(client)
    page.turn()
    assert page.dead_man.engaged


def test_a_page_that_takes_over_counts_its_own_grips():
    page = Page()
    for _ in range(5):
        page.engage()
    page.learns(holder='c2')
    page.turn()
    assert page.dead_man.grips == 5
    page.client, page.hand = 'c2', replace(page.hand, grip=0, seq=0)
    page.engage()
    assert page.dead_man.frame.grip == 1

    # And the first one, which has not let go of its fifth grip, counts on.
    page.client, page.hand = 'c1', replace(page.hand, grip=5, seq=100, pressed=True)
    page.learns(holder='c1')
    page.turn()
    page.send()
    page.let_go()
    page.send(pressed=True)
    page.turn()
    assert not page.dead_man.engaged
    page.engage()


def test_the_clutch_may_be_held_for_a_motion_that_waits_for_it():
    page = Page()
    page.learns(source='file', playing=True)
    page.turn()
    page.engage()
    page.learns(source='master', playing=False)
    page.turn()
    assert page.dead_man.reason is Reason.SOURCE


def test_nothing_is_engaged_before_anything_was_heard():
    dead_man = OperatorDeadMan()
    dead_man.turn(0, Conditions('c1', True, source='master', pictures=((0, 0),)))
    assert (dead_man.state, dead_man.reason, dead_man.missing) == (OPEN, None, Reason.SILENT)

from dataclasses import replace

import pytest
from page_in_virtual_time import MS, Page

from endoscope_console.teleop.frames import InputDevice
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
    'another source': (Reason.RELEASED, lambda page: page.send(source=InputDevice.POINTER)),
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


def test_nothing_is_engaged_before_anything_was_heard():
    dead_man = OperatorDeadMan()
    dead_man.turn(0, Conditions('c1', True, source='master', pictures=((0, 0),)))
    assert (dead_man.state, dead_man.reason, dead_man.missing) == (OPEN, None, Reason.SILENT)


def test_a_page_that_slept_while_another_operated_is_not_late():
    page = Page()
    page.engage()
    page.learns(holder='c2')
    page.turn(20)
    page.learns(holder='c1')
    page.turn()
    page.hand = replace(page.hand, pressed=False)
    for _ in range(5):
        page.send(late_ns=500 * MS)
        page.turn(20)
    assert page.dead_man.state is READY


def test_a_page_that_comes_back_counts_its_frames_anew():
    page = Page()
    page.engage()
    page.go_on(200)
    page.dead_man.closed('c1')
    page.turn()
    page.hand = replace(page.hand, seq=0)
    page.engage()

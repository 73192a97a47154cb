"""Alarms: order, and what stays until it was seen."""

import pytest

from endoscope_console.alarms import Alarm, Alarms, Level
from endoscope_core.errors import EndoscopeError

FAULT = Alarm('fault', Level.HIGH, 'a wire is over its ceiling', latched=True)
TRACKER = Alarm('tracker', Level.MEDIUM, 'the tracker is silent')
LOW = Alarm('a', Level.LOW, 'not calibrated')


def of(*alarms):
    return {alarm.id: alarm for alarm in alarms}


def test_the_most_urgent_first():
    assert Alarms().update(of(LOW, TRACKER, FAULT)) == (FAULT, TRACKER, LOW)


def test_a_fault_stays_until_it_was_seen_others_go_with_their_cause():
    alarms = Alarms()
    alarms.update(of(FAULT, TRACKER))
    assert alarms.update({}) == (FAULT,)
    alarms.acknowledge('fault')
    assert alarms.update({}) == ()


def test_to_have_seen_it_does_not_mend_it():
    alarms = Alarms()
    alarms.update(of(FAULT))
    with pytest.raises(EndoscopeError, match=f'still present: {FAULT.text}'):
        alarms.acknowledge('fault')
    assert alarms.update(of(FAULT)) == (FAULT,)
    assert alarms.update({}) == (FAULT,)


def test_there_may_be_nothing_to_acknowledge():
    with pytest.raises(EndoscopeError, match='nothing'):
        Alarms().acknowledge('fault')

"""Alarms: order, and what stays until it was seen."""

import pytest

from endoscope_console.alarms import Alarm, Alarms, Urgency
from endoscope_console.graph_side import is_calibrated
from endoscope_console.view import result
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.client.graph_listener import Health

FAULT = Alarm('fault', Urgency.HIGH, 'a wire is over its ceiling', latched=True)
TRACKER = Alarm('tracker', Urgency.MEDIUM, 'the tracker is silent')
LOW = Alarm('a', Urgency.LOW, 'not calibrated')


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
    with pytest.raises(EndoscopeError, match='nothing'):
        alarms.acknowledge('fault')
    alarms.update(of(FAULT))
    with pytest.raises(EndoscopeError, match=f'still present: {FAULT.text}'):
        alarms.acknowledge('fault')
    assert alarms.update(of(FAULT)) == (FAULT,)
    assert alarms.update({}) == (FAULT,)


def test_a_calibration_that_was_aborted_is_none():
    assert not is_calibrated(None)
    assert not is_calibrated(Health(2, 'aborted: a tension', {'step': 'recording'}, 1, 1))
    assert is_calibrated(Health(0, 'class 70 deg', {'class_deg': '70'}, 1, 1))


def test_a_tube_outside_all_classes_is_distinguished_from_an_abort_with_its_whole_reason():
    reason = 'none of the classes: the tensions are too far from those of all known tubes'
    refused = result(Health(2, reason, {'class_deg': 'none', 'reason': reason}, 1, 1))
    assert (refused['none'], refused['class_deg'], refused['message']) == (True, None, reason)
    assert not result(Health(2, 'aborted: a tension', {'step': 'recording'}, 1, 1))['none']

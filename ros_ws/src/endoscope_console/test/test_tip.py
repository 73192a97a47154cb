"""What pages receive of the force at the tip, and its alarms."""

import pytest

from endoscope_console.alarms import TipAlarms, TipState, Urgency, tip_state
from endoscope_nodes.client.graph_listener import Health

SECOND = 1_000_000_000


def health(level, message, **values):
    return Health(level, message, values, 1, 1)


FREE = health(0, 'nothing touches the tip', **{'visible [N]': '0.08'})


def test_what_would_be_seen_is_known_while_the_force_is():
    assert tip_state(FREE, 0.02) == TipState('', 0.08)


@pytest.mark.parametrize(
    ('report', 'age_s', 'why'),
    [
        (None, 0.0, 'silent'),
        (health(0, 'off'), 0.0, 'off'),
        (health(0, 'no force: calibrate with the sinusoid'), 0.02, 'calibrate with the sinusoid'),
        (health(0, 'nothing', **{'visible [N]': 'nan'}), 0.02, 'nothing'),
        (FREE, 0.51, 'silent'),
    ],
)
def test_why_there_is_no_force(report, age_s, why):
    assert tip_state(report, age_s) == TipState(why, None)


def test_an_alarm_keeps_the_largest_force_and_outlives_it_by_a_second():
    alarms = TipAlarms(0.2)
    assert alarms.update(1, 0.2, None) == []
    (alarm,) = alarms.update(2, 0.31, None)
    assert alarm.level is Urgency.HIGH
    assert alarm.text.startswith('0.31 N at the tip, above 0.2 N')
    assert alarms.update(3, 0.25, None) == [alarm]
    assert alarms.update(3 + SECOND, 0.0, None) == [alarm]
    assert alarms.update(4 + SECOND, 0.1, None) == []
    (later,) = alarms.update(2 * SECOND, 0.25, None)
    assert later.text.startswith('0.25 N')


def test_the_guard_says_that_it_acts_or_why_it_cannot():
    alarms = TipAlarms(0.2)
    yielding = health(1, 'yielding: bend_x pushes with 0.15 N', state='yielding')
    (yields,) = alarms.update(1, 0.15, yielding)
    assert yields.text == 'the guard holds the tip back: bend_x pushes with 0.15 N'
    (off,) = alarms.update(2, 0.0, health(0, 'off: no force is known', state='off'))
    assert off.text == 'the guard of the tip is off: no force is known'
    assert {yields.level, off.level} == {Urgency.LOW}
    assert alarms.update(3, 0.0, health(0, 'watching', state='watching')) == []

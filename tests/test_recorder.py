"""The recorder node: everything published is in the bag, as it was published."""

from pathlib import Path

import numpy as np
import pytest
from recorded_session import (
    CLUTCH,
    DIAGNOSTICS,
    SERVO,
    STATE,
    TRACKER,
    WIRES,
    N,
    RecordedSession,
    record_all_types,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from endoscope_bags import open_bag
from endoscope_bags.cdr import encode_clock, encode_joint_state, encode_string
from endoscope_bags.message_types import message_type
from endoscope_bags.recorder import new_bag
from endoscope_nodes.runtime.diagnostics import OK
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import EVENT, LOCK_STEP, RESULT, SENSOR_ASKED, SENSOR_OFFERED

MS = 10**6


@pytest.fixture(scope='module')
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp('recorded') / 'bag'
    sent, report = record_all_types(path)
    return sent, report, open_bag(path)


def test_nothing_is_lost_the_report_says_so_and_the_content_is_what_was_sent(recorded):
    sent, report, bag = recorded
    assert report.complete, report
    for topic, messages in sent.items():
        assert bag.topics[topic].message_count == report.counts[topic] == len(messages)
    assert bag.topics[DIAGNOSTICS].message_count >= 1
    assert not any(report.lost.values())
    # Latched, and from before the start.
    assert [message.data for _, message in bag.decoded(STATE)] == ['ENABLED']
    servo = bag.joint_state('motor/servo_jp')
    np.testing.assert_array_equal(servo.stamp_ns, [stamp for stamp, _ in sent[SERVO]])
    np.testing.assert_array_equal(servo.position, [values for _, values in sent[SERVO]])
    assert servo.names == ('motor_x', 'motor_y')
    wires = bag.joint_state('wires/measured_js')
    np.testing.assert_array_equal(wires.effort, [values for _, values in sent[WIRES]])
    assert wires.position is None
    np.testing.assert_array_equal(
        bag.poses('tracker/measured_cp').position, [values for _, values in sent[TRACKER]]
    )
    clutch = [message.buttons[0] for _, message in bag.decoded(CLUTCH)]
    assert clutch == sent[CLUTCH]


def test_times_and_numbers_are_those_of_the_middleware(recorded):
    _, _, bag = recorded
    times = bag.times(SERVO)
    stamps = bag.joint_state('motor/servo_jp', order='recorded').stamp_ns
    assert (times.publish_ns >= stamps).all()
    assert (times.log_ns >= times.publish_ns).all()
    np.testing.assert_array_equal(times.sequence, np.arange(1, N + 1))


def test_the_offered_qos_is_written_down(recorded):
    _, _, bag = recorded
    assert [(q.reliability, q.durability) for q in bag.topics[STATE].qos] == [
        ('reliable', 'transient_local')
    ]
    assert [(q.reliability, q.durability) for q in bag.topics[SERVO].qos] == [
        ('reliable', 'volatile')
    ]
    for topic in bag.topics.values():
        assert topic.type_hash == message_type(topic.type).type_hash


@pytest.mark.parametrize(
    ('given', 'message'),
    [({}, "'bag': .*exists already"), ({'topics': ['3 x']}, "'topics': '3 x' is not a topic name")],
)
def test_what_cannot_be_recorded_is_refused_before_anything_starts(tmp_path, given, message):
    (tmp_path / 'bag').mkdir(exist_ok=True)
    bag = tmp_path / ('bag' if not given else 'other')
    with pytest.raises(ParameterError, match=f'recorder: parameter {message}'):
        RecordedSession(bag=str(bag), **given)


def test_other_topics_are_recorded_once_their_type_is_known(tmp_path):
    with RecordedSession(bag=str(tmp_path / 'bag'), topics=['own', '/absolute']) as session:
        own = session.publisher(String, 'own', SENSOR_OFFERED)
        own.publish(String(data='x'))
        session.wait_for({'/endoscope/own': 1})
    bag = open_bag(tmp_path / 'bag')
    assert bag.topics['/endoscope/own'].type == 'std_msgs/msg/String'
    assert bag.message_count == 1


def test_a_publisher_that_offers_less_is_heard_all_the_same(tmp_path):
    with RecordedSession(bag=str(tmp_path / 'bag')) as session:
        wires = session.publisher(JointState, WIRES, SENSOR_ASKED)
        state = session.publisher(String, STATE, EVENT)
        for _ in range(10):
            wires.publish(encode_joint_state(['a'], 1, effort=[1.0]))
        state.publish(String(data='ENABLED'))
        session.wait_for({WIRES: 10, STATE: 1})
    bag = open_bag(tmp_path / 'bag')
    assert [q.reliability for q in bag.topics[WIRES].qos] == ['best_effort']
    assert [q.durability for q in bag.topics[STATE].qos] == ['volatile']
    assert (bag.topics[WIRES].message_count, bag.topics[STATE].message_count) == (10, 1)


def simulate(path, n=60):
    """Record a small graph in simulated time: a beat, an answer to it, and unstamped states."""
    topics = [SERVO, STATE]
    with RecordedSession(bag=str(path), topics=topics, simulated=True) as session:
        clock = session.probe.create_publisher(Clock, '/clock', LOCK_STEP)
        session.wait(clock.get_subscription_count)
        servo = session.publisher(JointState, SERVO, SENSOR_OFFERED)
        state = session.publisher(String, STATE, LOCK_STEP)
        # Before time has begun nothing is recorded as happening at 0.
        servo.publish(encode_joint_state(['a'], 1000 * MS, position=[-1.0]))
        session.serve(0.05)
        for k in range(n):
            now = (1000 + k) * MS
            clock.publish(encode_clock(now))
            session.wait(lambda now=now: session.recorder.ticker.now_ns() == now)
            servo.publish(encode_joint_state(['a'], now, position=[float(k)]))
            if k % 20 == 5:
                state.publish(encode_string(f'state {k}'))
        clock.publish(encode_clock((1000 + n) * MS))
        session.wait(lambda: session.recorder.ticker.now_ns() == (1000 + n) * MS)
    return open_bag(path)


def test_simulated_time_is_recorded_the_same_twice(tmp_path):
    bags = [simulate(tmp_path / name) for name in ('one', 'two')]
    one, two = ([tuple(m) for m in bag.messages()] for bag in bags)
    assert one == two
    series = bags[0].joint_state('motor/servo_jp', order='recorded')
    assert series.position[:, 0].tolist() == [-1.0, *range(60)]
    np.testing.assert_array_equal(series.log_ns, series.stamp_ns)
    np.testing.assert_array_equal(series.publish_ns, series.stamp_ns)
    states = [(m.log_ns // MS - 1000, s.data) for m, s in bags[0].decoded(STATE)]
    assert states == [(5, 'state 5'), (25, 'state 25'), (45, 'state 45')]


def test_recordings_without_a_name_have_different_ones_within_a_second(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('time.strftime', lambda how: how.replace('%', ''))
    names = []
    for _ in range(3):
        names.append(new_bag())
        Path(names[-1]).mkdir(parents=True)
    assert len(set(names)) == 3
    assert names[1:] == [f'{names[0]}-2', f'{names[0]}-3']


def test_nothing_is_recorded_unasked(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    session = RecordedSession(topics=[SERVO])
    state = session.probe.create_publisher(String, STATE, RESULT)
    with session:
        session.wait(state.get_subscription_count)
        state.publish(String(data='ENABLED'))
        session.serve(0.5)
        assert session.recorder._report() == (OK, 'not recording', {})
        begun, path = session.recorder.start_as_asked()
        assert begun
        assert session.recorder._report()[:2] == (OK, 'recording')
    assert list(tmp_path.glob('bags/recording-*')) == [tmp_path / path]

"""The replay node: the same bytes on the same topics, with the recorded time on /clock."""

import numpy as np
import pytest
from rclpy.context import Context
from recorded_session import SERVO, STATE, RecordedSession
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState

from endoscope_bags import BagWriter, open_bag
from endoscope_bags.cdr import encode_joint_state, encode_string
from endoscope_bags.message_types import JOINT_STATE, STRING
from endoscope_bags.topic import COMMAND_QOS, LATCHED_QOS
from endoscope_nodes.nodes.replay import ReplayNode
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import EVENT, SENSOR_OFFERED
from endoscope_nodes.runtime.runtime import Runtime

MS = 10**6
START = 1_790_000_000 * 10**9
N = 1000
OTHER = '/endoscope/other'


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('replay') / 'bag'
    with BagWriter(path) as writer:
        writer.add_topic(SERVO, JOINT_STATE, [COMMAND_QOS])
        writer.add_topic(STATE, STRING, [LATCHED_QOS])
        writer.write_raw(STATE, STRING, encode_string('ENABLED'), START)
        writer.write_raw(OTHER, STRING, encode_string('not asked for'), START)
        for k in range(N):
            cdr = encode_joint_state(['motor_x'], START + k * MS, position=[0.001 * k])
            writer.write_raw(SERVO, JOINT_STATE, cdr, START + k * MS + 300_000)
    return path


def replay_beside(session):
    """Replay in the process of a recorder until all is published."""
    node = session.runtime.add(ReplayNode)
    session.runtime.spin()
    return node


def test_what_is_replayed_is_what_was_recorded_and_the_clock_goes_before_it(bag, tmp_path):
    path = tmp_path / 'again'
    topics = [SERVO, STATE, '/clock', OTHER]
    replay = {
        'bag': str(bag),
        'topics': [SERVO, STATE],
        'speed': 2.0,
        'beside_live_nodes': True,
    }
    with RecordedSession(bag=str(path), topics=topics, replay=replay) as session:
        # The recorder learns the type of /clock from a first publisher.
        session.publisher(Clock, '/clock', EVENT)
        node = replay_beside(session)
        session.wait_for({SERVO: N, STATE: 1, '/clock': N})
    assert node.published == N + 1
    assert session.recorder.last_report.complete
    original, again = open_bag(bag), open_bag(path)
    for topic in (SERVO, STATE):
        sent = [m.data.rstrip(b'\0') for m in original.messages([topic])]
        heard = [m.data.rstrip(b'\0') for m in again.messages([topic])]
        assert heard == sent
    assert again.topics[STATE].qos[0].durability == 'transient_local'
    clock = [m.clock.sec * 10**9 + m.clock.nanosec for _, m in again.decoded('/clock')]
    assert clock == [START + k * MS for k in range(N)]
    servo = again.joint_state('motor/servo_jp', order='recorded')
    ticks = again.times('/clock').publish_ns
    latest = np.array(clock)[np.searchsorted(ticks, servo.publish_ns) - 1]
    assert (latest <= servo.stamp_ns).all()
    assert (servo.stamp_ns - latest < MS).all()


def test_a_running_system_is_not_talked_into(bag, tmp_path):
    replay = {'bag': str(bag)}
    with RecordedSession(bag=str(tmp_path / 'again'), replay=replay) as session:
        motor = session.probe.create_publisher(
            JointState, '/endoscope/motor/measured_js', SENSOR_OFFERED
        )
        session.wait(motor.get_subscription_count)
        node = replay_beside(session)
    assert node.exit_code == 1
    assert node.published == 0
    assert session.recorder.last_report.counts[SERVO] == 0


@pytest.mark.parametrize(
    ('overrides', 'words'),
    [
        ({'bag': '/nowhere'}, "replay: parameter 'bag': /nowhere: no such file"),
        ({'topics': ['/not_there']}, 'has no /not_there; it has /endoscope/motor/servo_jp'),
        ({'speed': 0.0}, "parameter 'speed' is 0.0"),
        ({'speed': float('nan')}, "parameter 'speed' is nan"),
    ],
)
def test_what_cannot_be_replayed_is_refused(bag, overrides, words):
    arguments = ['--ros-args', '--log-level', 'fatal']
    runtime = Runtime(
        arguments,
        context=Context(),
        domain_id=private_domain(),
        overrides={'replay': {'bag': str(bag)} | overrides},
    )
    with runtime, pytest.raises(ParameterError) as raised:
        runtime.add(ReplayNode)
    assert words in str(raised.value)

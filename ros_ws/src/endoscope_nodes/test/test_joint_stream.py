import struct
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from endoscope_bags.cdr import encode_joint_state
from endoscope_bags.errors import MalformedMessageError
from endoscope_nodes.runtime.streams import JointPublisher, JointReader

NAMES = ('bend_x', 'bend_y')
# The first message of a type loads its library.
settings.register_profile('patient', deadline=None)
settings.load_profile('patient')
values = st.floats(allow_nan=False, width=64)
pair = st.tuples(values, values)
stamps = st.integers(0, 2**31 * 10**9 - 1)


class Recorder:
    """Keeps the bytes that a publisher gives to ROS."""

    def __init__(self, sent):
        self._sent = sent

    def create_publisher(self, kind, topic, qos, **_):
        assert kind is JointState
        return SimpleNamespace(handle=SimpleNamespace(publish_raw=self._sent.append))


def message_of(names, stamp_ns, **fields):
    message = JointState(name=list(names), **{k: list(v) for k, v in fields.items()})
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 10**9)
    return message


@given(stamps, pair, pair)
def test_reads_what_ros_writes(stamp, position, velocity):
    data = serialize_message(message_of(NAMES, stamp, position=position, velocity=velocity))
    sample = JointReader(NAMES).read(data)
    assert sample[:4] == (stamp, position, velocity, ())


def test_reads_any_order_and_any_layout_with_the_same_reader():
    reader = JointReader(NAMES)
    for _ in range(2):
        assert reader.read(encode_joint_state(NAMES, 7, position=[1, 2])).position == (1, 2)
        swapped = encode_joint_state(['bend_y', 'other', 'bend_x'], 8, effort=[1, 2, 3])
        assert reader.read(swapped)[:4] == (8, (), (), (3, 1))
        framed = serialize_message(message_of(NAMES, 9, position=(5.0, 6.0), effort=(7.0, 8.0)))
        assert reader.read(framed) == (9, (5, 6), (), (7, 8), message_of(NAMES, 9).header.frame_id)


def test_reads_big_endian():
    names = struct.pack('>I', 2) + b''.join(
        struct.pack('>I', 7) + n.encode() + b'\0\0' for n in NAMES
    )
    body = struct.pack('>iIIB3x', 1, 2, 1, 0) + names[:-1]
    body += bytes(-len(body) % 4) + struct.pack('>I', 2)
    body += bytes(-len(body) % 8) + struct.pack('>2d', 3.0, 4.0) + struct.pack('>II', 0, 0)
    assert JointReader(NAMES).read(b'\x00\x00\x00\x00' + body)[:4] == (
        10**9 + 2,
        (3.0, 4.0),
        (),
        (),
    )


@given(pair, pair, pair)
def test_what_is_published_is_what_is_read(position, velocity, effort):
    sent = []
    publisher = JointPublisher(Recorder(sent), 't', NAMES, ('position', 'velocity', 'effort'), None)
    publisher.session = 'session-7'
    publisher.publish(5, *position, *velocity, *effort)
    assert JointReader(NAMES).read(sent[0]) == (5, position, velocity, effort, 'session-7')


@pytest.mark.parametrize(
    'message',
    [
        JointState(),
        JointState(name=['bend_x'], position=[1.0]),
        JointState(name=['bend_x', 'elbow'], position=[1.0, 2.0]),
    ],
)
def test_refuses_other_joints(message):
    with pytest.raises(MalformedMessageError, match='instead of bend_x, bend_y'):
        JointReader(NAMES).read(serialize_message(message))


def test_refuses_extra_joints_where_they_matter():
    data = encode_joint_state(['bend_x', 'bend_y', 'elbow'], 1, position=[1, 2, 3])
    assert JointReader(NAMES).read(data).position == (1, 2)
    with pytest.raises(MalformedMessageError):
        JointReader(NAMES, exact=True).read(data)


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(data):
    reader = JointReader(NAMES)
    for candidate in (data, encode_joint_state(NAMES, 1, position=[1, 2])[: len(data)]):
        try:
            reader.read(candidate)
        except MalformedMessageError:
            continue


def test_what_is_published_is_what_ros_reads():
    sent = []
    publisher = JointPublisher(Recorder(sent), 't', NAMES, ('position', 'effort'), None)
    publisher.publish(1_500_000_007, 0.1, 0.2, 0.3, 0.4)
    message = deserialize_message(sent[0], JointState)
    assert tuple(message.name) == NAMES
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == (1, 500_000_007)
    np.testing.assert_array_equal(message.position, [0.1, 0.2])
    np.testing.assert_array_equal(message.effort, [0.3, 0.4])
    assert len(message.velocity) == 0


def test_a_message_of_absurd_size_is_not_looked_at():
    data = encode_joint_state([f'joint_{k}' for k in range(10_000)], 1, position=[0.0] * 10_000)
    with pytest.raises(MalformedMessageError, match='at most 16384 are read'):
        JointReader(NAMES).read(data)

"""Our CDR against that of rosbags, in both directions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from endoscope_bags.cdr import (
    Payloads,
    TransformEncoder,
    encode_clock,
    encode_joint_state,
    encode_joint_states,
    encode_poses,
    encode_string,
)
from endoscope_bags.errors import BagError, MalformedMessageError
from endoscope_bags.joint_state_series import decode_joint_states, decode_poses
from endoscope_bags.message_types import (
    CLOCK,
    JOINT_STATE,
    POSE_STAMPED,
    STRING,
    TF_MESSAGE,
    typestore,
)

TEXT = st.text(st.characters(codec='utf-8', exclude_characters='\x00'), max_size=12)
STAMP = st.integers(0, 2**31 * 10**9 - 1)
NUMBER = st.floats(allow_nan=False)


@st.composite
def joint_states(draw, max_joints=5):
    names = draw(st.lists(TEXT, max_size=max_joints, unique=True))
    values = st.one_of(st.none(), st.lists(NUMBER, min_size=len(names), max_size=len(names)))
    return {
        'names': names,
        'stamp_ns': draw(STAMP),
        'frame_id': draw(TEXT),
        **{key: draw(values) for key in ('position', 'velocity', 'effort')},
    }


def as_object(state):
    types = typestore().types
    seconds, nanoseconds = divmod(state['stamp_ns'], 10**9)
    header = types['std_msgs/msg/Header'](
        stamp=types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds),
        frame_id=state['frame_id'],
    )
    numbers = {k: np.array(state[k] or [], dtype=float) for k in ('position', 'velocity', 'effort')}
    return types[JOINT_STATE](header=header, name=state['names'], **numbers)


def decoded(messages):
    size = np.array([len(m) for m in messages])
    payloads = Payloads(b''.join(messages), np.cumsum(size) - size, size)
    times = np.arange(len(messages))
    return decode_joint_states('/topic', payloads, times, times, times)


@given(joint_states())
@settings(deadline=None)
def test_a_joint_state_is_encoded_as_rosbags_does(state):
    expected = typestore().serialize_cdr(as_object(state), JOINT_STATE)
    assert encode_joint_state(**state) == bytes(expected)


@given(joint_states(), st.booleans())
@settings(deadline=None)
def test_what_rosbags_encodes_is_decoded_in_either_byte_order(state, little_endian):
    data = bytes(
        typestore().serialize_cdr(as_object(state), JOINT_STATE, little_endian=little_endian)
    )
    series = decoded([data])
    assert series.names == tuple(state['names'])
    assert series.stamp_ns.tolist() == [state['stamp_ns']]
    for quantity in ('position', 'velocity', 'effort'):
        values = getattr(series, quantity)
        assert ([] if values is None else values[0].tolist()) == (state[quantity] or [])


@given(st.lists(joint_states(max_joints=3), min_size=1, max_size=12))
@settings(deadline=None)
def test_messages_of_any_mixture_are_decoded_each_by_itself(states):
    series = decoded([encode_joint_state(**state) for state in states])
    for row, state in enumerate(states):
        assert series.stamp_ns[row] == state['stamp_ns']
        for quantity in ('position', 'velocity', 'effort'):
            values = getattr(series, quantity)
            given_values = dict(zip(state['names'], state[quantity] or [], strict=False))
            for column, name in enumerate(series.names):
                expected = given_values.get(name, np.nan)
                actual = np.nan if values is None else values[row, column]
                np.testing.assert_equal(actual, expected)


def test_a_topic_with_a_counter_in_its_frame_is_decoded_too():
    messages = [encode_joint_state(['a'], k, position=[k], frame_id=f'{k:04}') for k in range(200)]
    assert decoded(messages).position[:, 0].tolist() == list(range(200))


@given(st.lists(st.tuples(STAMP, st.lists(NUMBER, min_size=7, max_size=7)), min_size=1), TEXT)
@settings(deadline=None)
def test_poses_survive_the_round_trip_and_rosbags_reads_them(samples, frame_id):
    stamps = np.array([stamp for stamp, _ in samples])
    numbers = np.array([values for _, values in samples])
    messages = encode_poses(stamps, numbers[:, :3], numbers[:, 3:], frame_id=frame_id)
    size = np.array([len(m) for m in messages])
    payloads = Payloads(b''.join(messages), np.cumsum(size) - size, size)
    series = decode_poses('/pose', payloads, stamps, stamps, stamps)
    np.testing.assert_array_equal(series.stamp_ns, stamps)
    np.testing.assert_array_equal(series.position, numbers[:, :3])
    np.testing.assert_array_equal(series.orientation, numbers[:, 3:])
    assert series.frame_id == frame_id
    pose = typestore().deserialize_cdr(messages[0], POSE_STAMPED)
    assert (pose.pose.position.x, pose.pose.orientation.w) == (numbers[0, 0], numbers[0, 6])
    assert pose.header.frame_id == frame_id


@given(st.lists(st.tuples(TEXT, TEXT), max_size=4), st.lists(STAMP, min_size=1), st.data())
@settings(max_examples=50)
def test_transforms_are_encoded_as_rosbags_does(frames, stamps, data):
    encoder, types = TransformEncoder(frames), typestore().types
    numbers = st.lists(NUMBER, min_size=7, max_size=7)
    for stamp_ns in stamps:
        values = [data.draw(numbers) for _ in frames]
        seconds, nanoseconds = divmod(stamp_ns, 10**9)
        stamp = types['builtin_interfaces/msg/Time'](sec=seconds, nanosec=nanoseconds)
        message = types[TF_MESSAGE](
            transforms=[
                types['geometry_msgs/msg/TransformStamped'](
                    header=types['std_msgs/msg/Header'](stamp=stamp, frame_id=parent),
                    child_frame_id=child,
                    transform=types['geometry_msgs/msg/Transform'](
                        translation=types['geometry_msgs/msg/Vector3'](*row[:3]),
                        rotation=types['geometry_msgs/msg/Quaternion'](*row[3:]),
                    ),
                )
                for (parent, child), row in zip(frames, values, strict=True)
            ]
        )
        encoded = encoder.encode(stamp_ns, [(row[:3], row[3:]) for row in values])
        assert encoded == bytes(typestore().serialize_cdr(message, TF_MESSAGE))


def test_the_other_messages_are_read_back_by_rosbags():
    store = typestore()
    clock = store.deserialize_cdr(encode_clock(12_000_000_034), CLOCK)
    assert (clock.clock.sec, clock.clock.nanosec) == (12, 34)
    assert store.deserialize_cdr(encode_string('ENABLED'), STRING).data == 'ENABLED'


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(MalformedMessageError, match=r'position: shape \(2, 1\) where \(2, 2\)'):
        encode_joint_states(['a', 'b'], [1, 2], position=[[1.0], [2.0]])
    with pytest.raises(MalformedMessageError, match='integers in ns'):
        encode_joint_states(['a'], [1.5], position=[[1.0]])
    with pytest.raises(MalformedMessageError, match='32 bits'):
        encode_joint_states(['a'], [2**62], position=[[1.0]])


@given(joint_states(), st.integers(0, 30))
@settings(deadline=None)
def test_a_message_cut_short_is_refused(state, missing):
    data = encode_joint_state(**state)
    cut = data[: len(data) - 1 - missing % len(data)]
    with pytest.raises(MalformedMessageError, match='topic /topic: message 1 '):
        decoded([cut])


@pytest.mark.parametrize(
    ('data', 'what'),
    [
        (b'\x00\x03\x00\x00' + bytes(40), 'not plain CDR'),
        (b'', 'begins with nothing'),
        (bytes([0, 1, 0, 0]) + bytes(12) + b'\xff\xff\xff\xff' + bytes(40), 'claims'),
    ],
)
def test_what_is_no_joint_state_is_refused(data, what):
    with pytest.raises(MalformedMessageError, match=what):
        decoded([data])


def test_more_values_than_names_are_refused():
    other = encode_joint_state(['a', 'b'], 0, position=[1, 2])
    at = other.index(b'b\x00') + 4
    wrong = other[:at] + b'\x03' + other[at + 1 :] + bytes(8)
    with pytest.raises(MalformedMessageError, match='3 values of position for 2 names'):
        decoded([wrong])


def test_nan_is_named_with_topic_joint_and_time():
    values = [[0.0, 0.0], [0.0, np.nan], [0.0, np.inf]]
    series = decoded(encode_joint_states(['a', 'b'], [0, 10**9, 2 * 10**9], position=values))
    expected = r'/topic: position of b is nan at 1\.000000 s; 2 of 3 messages'
    with pytest.raises(BagError, match=expected):
        series.check_finite()
    series.check_finite(['velocity'])

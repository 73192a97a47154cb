"""What the writer leaves on disk, seen by the mcap library and by rosbags."""

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from endoscope_bags import BagWriter, MessageStream, open_bag
from endoscope_bags.cdr import encode_joint_states, encode_string
from endoscope_bags.errors import BagError, BagExistsError, MalformedMessageError, UnknownTypeError
from endoscope_bags.message_types import JOINT_STATE, STRING, message_type
from endoscope_bags.topic import LATCHED_QOS, SENSOR_QOS, qos_from_yaml

START = 1_790_000_000 * 10**9
SERVO = '/endoscope/motor/servo_jp'
STATE = '/endoscope/slave/operating_state'


def servo_stream(n=3000):
    stamps = START + np.arange(n) * 10**6
    angle = np.sin(np.arange(2 * n)).reshape(n, 2)
    payloads = encode_joint_states(['motor_x', 'motor_y'], stamps, position=angle)
    return MessageStream(SERVO, JOINT_STATE, payloads, stamps + 2000, stamps + 1000)


@pytest.fixture
def bag(tmp_path):
    path = tmp_path / 'made'
    with BagWriter(path) as writer:
        writer.add_topic(SERVO, JOINT_STATE, [SENSOR_QOS])
        writer.add_topic(STATE, STRING, [LATCHED_QOS])
        writer.write_streams([servo_stream()])
        writer.write_raw(STATE, STRING, encode_string('ENABLED'), START + 10**9)
        writer.close({'note': 'by hand'})
    return path


def test_the_folder_is_laid_out_as_rosbag2_does(bag):
    assert sorted(p.name for p in bag.iterdir()) == ['made_0.mcap', 'metadata.yaml']
    assert [p.name for p in bag.parent.iterdir()] == ['made']


def test_the_metadata_have_every_key_of_version_9(bag):
    text = (bag / 'metadata.yaml').read_text()
    information = yaml.safe_load(text)['rosbag2_bagfile_information']
    assert information == {
        'version': 9,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': 2_999_000_000},
        'starting_time': {'nanoseconds_since_epoch': START + 2000},
        'message_count': 3001,
        'topics_with_message_count': [
            {
                'topic_metadata': {
                    'name': name,
                    'type': kind,
                    'serialization_format': 'cdr',
                    'offered_qos_profiles': [qos.as_rosbag2()],
                    'type_description_hash': message_type(kind).type_hash,
                },
                'message_count': count,
            }
            for name, kind, qos, count in (
                (SERVO, JOINT_STATE, SENSOR_QOS, 3000),
                (STATE, STRING, LATCHED_QOS, 1),
            )
        ],
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': ['made_0.mcap'],
        'files': [
            {
                'path': 'made_0.mcap',
                'starting_time': {'nanoseconds_since_epoch': START + 2000},
                'duration': {'nanoseconds': 2_999_000_000},
                'message_count': 3001,
            }
        ],
        'custom_data': {'note': 'by hand'},
        'ros_distro': 'jazzy',
    }
    assert '&id' not in text


def test_the_mcap_library_finds_everything_through_the_index(bag):
    with (bag / 'made_0.mcap').open('rb') as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        summary = reader.get_summary()
        statistics = summary.statistics
        messages = list(reader.iter_messages())
        late = list(reader.iter_messages(topics=[SERVO], starting_at=START + 2 * 10**9))
        notes = {record.name: record.metadata for record in reader.iter_metadata()}
    assert statistics.message_count == len(messages) == 3001
    assert statistics.channel_message_counts == {1: 3000, 2: 1}
    assert statistics.chunk_count == len(summary.chunk_indexes)
    assert (statistics.message_start_time, statistics.message_end_time) == (
        START + 2000,
        START + 2_999_002_000,
    )
    assert len(late) == 1000
    schema, channel, message = messages[5]
    assert (schema.name, schema.encoding, channel.message_encoding) == (
        JOINT_STATE,
        'ros2msg',
        'cdr',
    )
    assert schema.data.decode() == message_type(JOINT_STATE).definition
    assert channel.metadata['topic_type_hash'] == message_type(JOINT_STATE).type_hash
    assert qos_from_yaml(channel.metadata['offered_qos_profiles']) == (SENSOR_QOS,)
    assert (message.sequence, message.log_time, message.publish_time) == (
        6,
        START + 5_002_000,
        START + 5_001_000,
    )
    assert notes['endoscope_bags'] == {'note': 'by hand'}
    assert yaml.safe_load(notes['rosbag2']['serialized_metadata']) == yaml.safe_load(
        (bag / 'metadata.yaml').read_text()
    )


def test_rosbags_reads_the_folder_and_the_bare_file(bag):
    for path in (bag, bag / 'made_0.mcap'):
        with AnyReader([path]) as reader:
            assert reader.message_count == 3001
            assert {c.topic: c.msgcount for c in reader.connections} == {SERVO: 3000, STATE: 1}
            connection = next(c for c in reader.connections if c.topic == SERVO)
            # rosbags reads the hash from the metadata only.
            assert path.is_file() or connection.digest == message_type(JOINT_STATE).type_hash
            assert connection.ext.offered_qos_profiles[0].depth == SENSOR_QOS.depth
            rows = [
                (log, reader.deserialize(raw, connection.msgtype))
                for _, log, raw in reader.messages([connection])
            ]
        log, message = rows[7]
        assert log == START + 7_002_000
        assert message.name == ['motor_x', 'motor_y']
        np.testing.assert_array_equal(message.position, np.sin([14, 15]))


def test_messages_of_a_chunk_are_sorted_by_receipt(tmp_path):
    path = tmp_path / 'sorted.mcap'
    with BagWriter(path) as writer:
        for log in (5, 3, 9, 1):
            writer.write_raw('/a', STRING, encode_string(str(log)), log)
    with path.open('rb') as file:
        logs = [message.log_time for _, _, message in make_reader(file).iter_messages()]
        file.seek(0)
        in_file = [m.log_time for _, _, m in make_reader(file).iter_messages(log_time_order=False)]
    assert logs == in_file == [1, 3, 5, 9]


def test_a_topic_that_comes_late_is_described_before_its_messages(tmp_path):
    path = tmp_path / 'late.mcap'
    with BagWriter(path) as writer:
        writer.write_raw('/a', STRING, encode_string('x'), 1)
        writer.flush()
        writer.write_raw('/b', JOINT_STATE, servo_stream(1).payloads[0], 2)
    with path.open('rb') as file:
        names = [channel.topic for _, channel, _ in make_reader(file).iter_messages()]
    assert names == ['/a', '/b']


def test_the_same_messages_give_the_same_bytes(tmp_path):
    for name in ('one', 'two'):
        (tmp_path / name).mkdir()
        with BagWriter(tmp_path / name / 'bag', threaded=name == 'two') as writer:
            writer.write_streams([servo_stream()])
    files = [
        {p.name: p.read_bytes() for p in (tmp_path / name / 'bag').iterdir()}
        for name in ('one', 'two')
    ]
    assert files[0] == files[1]


@pytest.mark.parametrize('name', ['taken', 'taken.mcap'])
def test_nothing_is_ever_overwritten(tmp_path, name):
    taken = tmp_path / name
    taken.write_bytes(b'precious')
    with pytest.raises(BagExistsError, match=f'{name}: exists already'):
        BagWriter(taken)
    assert taken.read_bytes() == b'precious'
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize('name', ['bag', 'bag.mcap'])
def test_an_atomic_writer_that_fails_leaves_nothing(tmp_path, name):
    with pytest.raises(ZeroDivisionError), BagWriter(tmp_path / name) as writer:
        writer.write_streams([servo_stream()])
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


def test_a_writer_that_is_not_atomic_keeps_what_it_has(tmp_path):
    def write_and_fail():
        with BagWriter(tmp_path / 'bag', atomic=False) as writer:
            writer.write_streams([servo_stream()])
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        write_and_fail()
    assert open_bag(tmp_path / 'bag').message_count == 3000


def test_the_sequence_goes_on_from_call_to_call(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.write_streams([servo_stream()])
        writer.write_streams([servo_stream()])
    numbers = [message.sequence for message in open_bag(tmp_path / 'bag').stored_messages()]
    assert sorted(numbers) == list(range(1, 6001))


def test_a_place_that_cannot_be_written_is_one_clear_error(tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(BagError, match='cannot be created'):
        BagWriter(tmp_path / 'file' / 'bag')


def test_an_unknown_type_is_refused_and_the_writer_goes_on(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        with pytest.raises(UnknownTypeError, match='no_msgs'):
            writer.write_raw('/a', 'no_msgs/msg/Such', b'', 1)
        writer.write_raw('/b', STRING, encode_string('x'), 1)
    assert list(open_bag(tmp_path / 'bag').topics) == ['/b']


def test_times_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match='/a: times'):
        MessageStream('/a', STRING, [b''], np.array([1.0]))
    with pytest.raises(ValueError, match='/a: times'):
        MessageStream('/a', STRING, [b''], np.array([1, 2]))


def test_a_negative_time_is_refused(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer, pytest.raises(MalformedMessageError, match='-3 ns'):
        writer.write_raw('/a', STRING, encode_string('x'), 1, -3)


def test_git_ignores_a_folder_of_bags_that_is_made_for_one(tmp_path):
    (tmp_path / 'mine').mkdir()
    for folder in ('bags', 'mine', 'other'):
        with BagWriter(tmp_path / folder / 'bag'):
            pass
    assert (tmp_path / 'bags' / '.gitignore').read_text() == '*\n'
    assert not list(tmp_path.glob('[mo]*/.gitignore'))

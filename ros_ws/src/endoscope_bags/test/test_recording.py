"""Reading: any namespace, order, rate and joints; each flaw one clear error."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Sqlite3Writer

from endoscope_bags import BagError, BagWriter, open_bag
from endoscope_bags.cdr import encode_joint_state, encode_string
from endoscope_bags.errors import BagNotFoundError, CorruptBagError, MalformedMessageError
from endoscope_bags.listing import bags_in
from endoscope_bags.message_types import JOINT_STATE, STRING, typestore
from endoscope_bags.topic import SENSOR_QOS

MS = 10**6


def write(path, topic='/robot/left/motor/measured_js', n=500, kind=JOINT_STATE, data=None):
    with BagWriter(path) as writer:
        for k in range(n):
            cdr = data or encode_joint_state(
                ['motor_y', 'motor_x'], k * MS, position=[k + 0.5, k], effort=[0.25, 0.125]
            )
            writer.write_raw(topic, kind, cdr, k * MS + 7, k * MS + 5, k + 1)
    return path


def test_any_namespace_and_joint_order(tmp_path):
    bag = open_bag(write(tmp_path / 'bag'))
    series = bag.joint_state('motor/measured_js').select(['motor_x', 'motor_y'])
    assert series.topic == '/robot/left/motor/measured_js'
    np.testing.assert_array_equal(series.position[:, 0], np.arange(500))
    np.testing.assert_array_equal(series.position[:, 1], np.arange(500) + 0.5)
    assert series.velocity is None
    assert series.effort[3].tolist() == [0.125, 0.25]
    assert series.stamp_ns.dtype == np.int64
    np.testing.assert_array_equal(series.stamp_ns, np.arange(500) * MS)
    np.testing.assert_array_equal(series.log_ns - series.stamp_ns, np.full(500, 7))
    np.testing.assert_array_equal(series.publish_ns - series.stamp_ns, np.full(500, 5))
    np.testing.assert_array_equal(series.sequence, np.arange(500) + 1)
    np.testing.assert_allclose(series.seconds(), np.arange(500) * 1e-3)
    one = series.select(['motor_y'])
    assert one.names == ('motor_y',)
    assert one.position.shape == (500, 1)


def test_a_suffix_matches_whole_names_only(tmp_path):
    bag = open_bag(write(tmp_path / 'bag', topic='/fast_motor/measured_js', n=1))
    assert not bag.has('motor/measured_js')
    with pytest.raises(BagError, match='lacks topic motor/measured_js; it has /fast_'):
        bag.joint_state('motor/measured_js')


def test_two_namespaces_have_to_be_distinguished(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        for k, topic in enumerate(('/a/wires/measured_js', '/b/wires/measured_js')):
            writer.write_raw(topic, JOINT_STATE, encode_joint_state(['w'], k, effort=[k]), k)
    bag = open_bag(tmp_path / 'bag')
    with pytest.raises(BagError, match='/a/wires/measured_js or /b/wires/measured_js'):
        bag.joint_state('wires/measured_js')
    for namespace in ('/b', 'b'):
        found = bag.joint_state('wires/measured_js', namespace=namespace)
        assert found.effort.tolist() == [[1.0]]
    assert bag.joint_state('/a/wires/measured_js').effort.tolist() == [[0.0]]


def test_messages_out_of_order_are_sorted_by_stamp_unless_asked_otherwise(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        for log, stamp in enumerate((3, 1, 2)):
            cdr = encode_joint_state(['a'], stamp, position=[stamp])
            writer.write_raw('/x', JOINT_STATE, cdr, log)
    bag = open_bag(tmp_path / 'bag')
    assert bag.joint_state('x').position[:, 0].tolist() == [1, 2, 3]
    assert bag.joint_state('x', order='recorded').position[:, 0].tolist() == [3, 1, 2]


def test_a_joint_that_is_not_there_is_named(tmp_path):
    series = open_bag(write(tmp_path / 'bag', n=1)).joint_state('motor/measured_js')
    with pytest.raises(BagError, match='no joint motor_z; it has motor_y, motor_x'):
        series.select(['motor_z', 'motor_x'])
    with pytest.raises(BagError, match='has no velocity'):
        series.require('velocity')


def test_nan_is_refused_where_it_matters(tmp_path):
    data = encode_joint_state(['a'], 5 * MS, position=[np.nan], effort=[1.0])
    bag = open_bag(write(tmp_path / 'bag', n=1, data=data))
    with pytest.raises(BagError, match='position of a is nan'):
        bag.joint_state('motor/measured_js')
    assert bag.joint_state('motor/measured_js', finite=('effort',)).effort.tolist() == [[1.0]]


def test_another_type_is_named(tmp_path):
    path = write(tmp_path / 'bag', n=1, kind=STRING, data=encode_string('x'))
    with pytest.raises(BagError, match='is std_msgs/msg/String, not sensor_msgs/msg/JointS'):
        open_bag(path).joint_state('motor/measured_js')


def test_bytes_that_do_not_decode_are_named(tmp_path):
    path = write(tmp_path / 'bag', n=2, data=b'\x00\x01\x00\x00\x01')
    bag = open_bag(path)
    with pytest.raises(MalformedMessageError, match=r'motor/measured_js: message 1 ends after 5'):
        bag.joint_state('motor/measured_js')
    with pytest.raises(MalformedMessageError, match='message 1 does not decode'):
        list(bag.decoded('/robot/left/motor/measured_js'))


def test_messages_come_by_receipt_over_all_topics(tmp_path):
    with BagWriter(tmp_path / 'bag', chunk_seconds=1e-9) as writer:
        for log, topic in ((5, '/a'), (1, '/b'), (3, '/a'), (2, '/b')):
            writer.write_raw(topic, STRING, encode_string(str(log)), log)
    bag = open_bag(tmp_path / 'bag')
    came = [(m.log_ns, m.topic) for m in bag.messages()]
    assert came == [(1, '/b'), (2, '/b'), (3, '/a'), (5, '/a')]
    assert [m.log_ns for m in bag.messages(['/a'])] == [3, 5]
    assert (bag.start_ns, bag.end_ns, bag.message_count) == (1, 5, 4)


@pytest.mark.parametrize('compression', list(CompressionType))
@pytest.mark.parametrize('use_chunking', [True, False])
def test_files_of_another_writer(tmp_path, compression, use_chunking):
    path = tmp_path / 'other.mcap'
    with path.open('wb') as file:
        writer = Writer(file, compression=compression, use_chunking=use_chunking, chunk_size=2000)
        writer.start(profile='ros2', library='other')
        schema = writer.register_schema(JOINT_STATE, 'ros2msg', b'')
        channel = writer.register_channel('/ns/slave/servo_jp', 'cdr', schema)
        for k in range(100):
            cdr = encode_joint_state(['bend_x'], k * MS, position=[k])
            writer.add_message(channel, k, cdr, k)
        writer.finish()
    bag = open_bag(path)
    np.testing.assert_array_equal(bag.joint_state('slave/servo_jp').position[:, 0], np.arange(100))
    assert bag.library == 'other'


def test_a_folder_with_several_files(tmp_path):
    folder = write(tmp_path / 'bag', n=10)
    write(tmp_path / 'more.mcap', n=5).rename(folder / 'bag_1.mcap')
    metadata = folder / 'metadata.yaml'
    text = metadata.read_text().replace('- bag_0.mcap', '- bag_0.mcap\n  - bag_1.mcap')
    metadata.write_text(text)
    assert open_bag(folder).joint_state('motor/measured_js').stamp_ns.shape == (15,)
    metadata.unlink()
    assert open_bag(folder).message_count == 15


def test_what_is_no_bag_is_named(tmp_path):
    (tmp_path / 'empty.mcap').write_bytes(b'')
    (tmp_path / 'text.mcap').write_text('joint states, sort of, but not in any known format')
    (tmp_path / 'noise.mcap').write_bytes(bytes(range(256)))
    (tmp_path / 'folder').mkdir()
    for name, error, what in (
        ('absent', BagNotFoundError, 'absent: no such file or folder'),
        ('empty.mcap', BagError, 'empty.mcap: empty file'),
        ('text.mcap', BagError, 'text.mcap: text, no recording'),
        ('noise.mcap', BagError, 'noise.mcap: not an MCAP recording'),
        ('folder', BagError, 'neither metadata.yaml nor any .mcap'),
    ):
        with pytest.raises(error, match=what) as raised:
            open_bag(tmp_path / name)
        assert isinstance(raised.value, BagError)
        assert '\n' not in str(raised.value)


def test_a_recording_without_messages_is_reported(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        writer.add_topic('/a', STRING)
    with pytest.raises(BagError, match='bag: holds no message'):
        open_bag(tmp_path / 'bag')


@pytest.mark.parametrize(
    ('changed', 'what'),
    [
        (lambda good: 'a: [', 'is not YAML'),
        (lambda good: 'a: 1', 'not the metadata of a rosbag2'),
        (lambda good: '', 'not the metadata of a rosbag2'),
        (lambda good: good.replace('tifier: mcap', 'tifier: tape'), 'storage tape.*bag convert'),
        (lambda good: good.replace("mode: ''", 'mode: FILE'), 'compression mode FILE'),
        (lambda good: good.replace('bag_0', 'bag_7'), r'bag_7\.mcap: missing, though'),
    ],
)
def test_metadata_that_do_not_lead_to_messages_are_named(tmp_path, changed, what):
    metadata = write(tmp_path / 'bag', n=1) / 'metadata.yaml'
    metadata.write_text(changed(metadata.read_text()))
    with pytest.raises(BagError, match=what):
        open_bag(tmp_path / 'bag')


def test_the_error_for_sqlite3_storage_names_the_conversion(tmp_path):
    old = tmp_path / 'my old'
    with Sqlite3Writer(old, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection('/rig/a', JOINT_STATE, typestore=typestore())
        for k in range(9):
            writer.write(topic, k, encode_joint_state(['bend_x'], k, position=[k]))
    for path in (old, old / 'my old.db3'):
        with pytest.raises(BagError, match='sqlite3 storage') as caught:
            open_bag(path)
        [command] = re.findall('rosbags-convert .*', str(caught.value))
        program, *words = shlex.split(command)
        subprocess.run([Path(sys.executable).with_name(program), *words], check=True)
        assert open_bag(words[words.index('--dst') + 1]).joint_state('a').position[8, 0] == 8
    [entry] = [entry for entry in bags_in(tmp_path) if entry.name == 'my old']
    assert 'rosbags-convert' in entry.trouble
    (old / 'metadata.yaml').unlink()
    with pytest.raises(BagError, match=r'old\.db3: .* rosbags-convert'):
        open_bag(old)


def test_every_cut_is_noticed(tmp_path):
    whole = write(tmp_path / 'bag.mcap').read_bytes()
    cut = tmp_path / 'cut.mcap'
    for length in (8, 20, 300, len(whole) // 2, len(whole) - 9, len(whole) - 1):
        cut.write_bytes(whole[:length])
        with pytest.raises(CorruptBagError, match=r'ends in the middle.*endoscope bag recover'):
            open_bag(cut)


def test_a_flipped_bit_is_noticed(tmp_path):
    path = write(tmp_path / 'bag.mcap')
    data = bytearray(path.read_bytes())
    with path.open('rb') as stream:
        first = make_reader(stream).get_summary().chunk_indexes[0]
    data[first.chunk_start_offset + first.chunk_length // 2] ^= 0x10
    path.write_bytes(data)
    with pytest.raises(CorruptBagError, match=r'chunk 1 .* is damaged'):
        open_bag(path)


def test_a_topic_without_a_message_is_reported_as_empty(tmp_path):
    with BagWriter(tmp_path / 'bag') as writer:
        for topic in ('/a/motor/servo_jp', '/a/wires/measured_js'):
            writer.add_topic(topic, JOINT_STATE, [SENSOR_QOS])
        wires = encode_joint_state(['w'], 0, effort=[1.0])
        writer.write_raw('/a/wires/measured_js', JOINT_STATE, wires, 0)
    bag = open_bag(tmp_path / 'bag')
    with pytest.raises(BagError, match=r'no message was recorded on /a/motor/servo_jp$'):
        bag.joint_state('motor/servo_jp')
    with pytest.raises(BagError, match=r'lacks topic wires/measured_js; it has /a/wires'):
        bag.joint_state('wires/measured_js', namespace='/b')
    assert bag.lacking('motor/servo_jp', 'slave/servo_jp').endswith(
        ': no message was recorded on /a/motor/servo_jp; '
        'lacks topic slave/servo_jp; it has /a/wires/measured_js'
    )

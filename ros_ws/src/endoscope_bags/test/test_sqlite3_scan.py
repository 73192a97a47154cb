"""Recordings in sqlite3 storage, written by `rosbags` as rosbag2 does, read like any other."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer

from endoscope_bags import BagError, open_bag
from endoscope_bags.cdr_encoding import encode_joint_state, encode_string
from endoscope_bags.copying import recover
from endoscope_bags.errors import CorruptBagError
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import JOINT_STATE, STRING, typestore

MS = 10**6
N = 5000


def write(folder, n=N, version=9):
    with Writer(folder, version=version, storage_plugin=StoragePlugin.SQLITE3) as writer:
        names = ('/rig/slave/servo_jp', '/rig/slave/measured_js')
        topics = [writer.add_connection(t, JOINT_STATE, typestore=typestore()) for t in names]
        state = writer.add_connection('/rig/state', STRING, typestore=typestore())
        for k in range(n):
            for topic in topics[: 1 + (k % 25 == 0)]:
                cdr = encode_joint_state(['bend_x', 'bend_y'], k * MS, position=[k, -k])
                writer.write(topic, k * MS, cdr)
        writer.write(state, 0, encode_string('ENABLED'))
    return folder


def changed(folder, *statements):
    [path] = folder.glob('*.db3')
    with closing(sqlite3.connect(path)) as file, file:
        for statement in statements:
            file.executescript(statement)
    return folder


@pytest.mark.parametrize('version', [8, 9])
@pytest.mark.parametrize('bare', [False, True])
def test_it_is_read_as_any_recording(tmp_path, version, bare):
    folder = write(tmp_path / 'bag', version=version)
    bag = open_bag(folder / 'bag.db3' if bare else folder)
    assert bag.message_count == N + N // 25 + 1
    command, measured = bag.joint_state('slave/servo_jp'), bag.joint_state('slave/measured_js')
    assert command.names == ('bend_x', 'bend_y')
    assert np.array_equal(command.position[:, 1], -np.arange(N))
    assert np.array_equal(command.stamp_ns, np.arange(N) * MS)
    assert np.array_equal(measured.stamp_ns, np.arange(0, N, 25) * MS)
    [(_, state)] = bag.decoded('/rig/state')
    assert state.data == 'ENABLED'


def test_what_the_storage_does_not_tell_is_not_told(tmp_path):
    information = bag_information(open_bag(write(tmp_path / 'bag')))
    servo = next(t for t in information.topics if t.name == '/rig/slave/servo_jp')
    assert (servo.rate_hz, servo.lost) == (pytest.approx(1000.0), None)
    assert 'sqlite3' in information.library


def test_a_folder_without_metadata_and_an_old_schema(tmp_path):
    """Before Iron topics had no hash, and definitions were not stored."""
    folder = changed(
        write(tmp_path / 'bag'),
        'DROP TABLE message_definitions; DROP TABLE schema; DROP TABLE metadata',
        'ALTER TABLE topics DROP COLUMN type_description_hash',
    )
    (folder / 'metadata.yaml').unlink()
    assert len(open_bag(folder).joint_state('slave/servo_jp')) == N


def test_it_becomes_an_mcap(tmp_path):
    source = open_bag(write(tmp_path / 'bag'))
    assert recover(tmp_path / 'bag', tmp_path / 'new').damage == ()
    new = open_bag(tmp_path / 'new')
    assert new.message_count == source.message_count
    assert (new.path / 'new_0.mcap').is_file()
    for topic in source.topics:
        old, now = source.payloads(topic), new.payloads(topic)
        assert [old[k] for k in range(len(old))] == [now[k] for k in range(len(now))]


@pytest.mark.parametrize(
    ('statement', 'error', 'what'),
    [
        ('DROP TABLE messages', BagError, 'a database that is not a rosbag2 recording'),
        (
            (
                'ALTER TABLE messages RENAME TO m; CREATE VIEW messages AS WITH RECURSIVE n(x) AS '
                '(SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x AS id, 1 AS topic_id, x AS '
                "timestamp, x'00' AS data FROM n"
            ),
            BagError,
            'a database that is not a rosbag2 recording',
        ),
        ('DELETE FROM messages', BagError, 'holds no message'),
        ('UPDATE messages SET timestamp = -1 WHERE id = 9', CorruptBagError, 'timed -1 ns'),
        ("UPDATE messages SET timestamp = 'x' WHERE id = 9", CorruptBagError, 'row 9'),
        ("UPDATE messages SET data = 'text' WHERE id = 9", CorruptBagError, 'row 9'),
        ('UPDATE messages SET topic_id = 77 WHERE id = 9', CorruptBagError, 'row 9'),
        ("UPDATE topics SET serialization_format = 'json'", BagError, 'encoding .json.'),
        (
            (
                'CREATE TABLE new(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, '
                'data BLOB AS (zeroblob(60000000))); INSERT INTO new SELECT id, topic_id, '
                'timestamp FROM messages; DROP TABLE messages; ALTER TABLE new RENAME TO messages'
            ),
            CorruptBagError,
            'its tables hold more than the file',
        ),
    ],
)
def test_what_is_no_recording_is_one_line(tmp_path, statement, error, what):
    with pytest.raises(error, match=what) as caught:
        open_bag(changed(write(tmp_path / 'bag', n=100), statement))
    assert '\n' not in str(caught.value)


@pytest.mark.parametrize('share', [0.001, 0.5, 0.999])
def test_a_file_that_was_cut_is_one_line(tmp_path, share):
    [path] = write(tmp_path / 'bag').glob('*.db3')
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    with pytest.raises(CorruptBagError, match=r'bag\.db3: ends in the middle .*copy it again'):
        open_bag(tmp_path / 'bag')


def test_what_lies_before_a_damaged_page_is_saved(tmp_path):
    [path] = write(tmp_path / 'bag').glob('*.db3')
    content = bytearray(path.read_bytes())
    middle = len(content) // 2 // 4096 * 4096
    content[middle : middle + 4 * 4096] = bytes(4 * 4096)
    path.write_bytes(content)
    with pytest.raises(CorruptBagError, match=r'damaged: .*endoscope bag recover'):
        open_bag(tmp_path / 'bag')
    assert recover(tmp_path / 'bag', tmp_path / 'saved').damage
    command = open_bag(tmp_path / 'saved').joint_state('slave/servo_jp')
    assert 0 < len(command) < N
    assert np.array_equal(command.position[:, 0], np.arange(len(command)))


def test_what_only_has_the_name_is_one_line(tmp_path):
    (tmp_path / 'bag.db3').write_bytes(b'something else')
    with pytest.raises(BagError, match='not an sqlite3 recording'):
        open_bag(tmp_path / 'bag.db3')

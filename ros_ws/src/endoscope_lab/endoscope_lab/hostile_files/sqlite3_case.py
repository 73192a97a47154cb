"""Spoiled recordings in sqlite3 storage: bytes, cells and the very tables."""

import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

from numpy.random import Generator
from rosbags.rosbag2 import StoragePlugin, Writer

from endoscope_bags import BagError, open_bag
from endoscope_bags.cdr_encoding import encode_joint_state
from endoscope_bags.copying import recover
from endoscope_bags.information import bag_information
from endoscope_bags.message_types import JOINT_STATE, typestore
from endoscope_core.errors import printable
from endoscope_lab.hostile_files.spoiling import BOUNDARIES, EVIL_NAMES, spoiled_bytes

MESSAGES = 400
TABLES_THAT_ARE_NONE = (
    'DROP TABLE messages',
    'DROP TABLE topics; CREATE VIEW topics AS SELECT 1 AS id',
    (
        'ALTER TABLE messages RENAME TO kept; CREATE VIEW messages AS WITH RECURSIVE n(x) AS '
        '(SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT x AS id, 1 AS topic_id, x AS timestamp, '
        'zeroblob(100000) AS data FROM n'
    ),
    (
        'DROP TABLE messages; CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER '
        'DEFAULT 1, timestamp INTEGER DEFAULT 1, data BLOB AS (zeroblob(60000000))); '
        'INSERT INTO messages(id) VALUES (1)'
    ),
    'UPDATE messages SET data = zeroblob(50000000) WHERE id = 7',
    "UPDATE messages SET data = 'text', timestamp = 'soon'",
    'UPDATE messages SET timestamp = -timestamp - 1',
    'UPDATE messages SET topic_id = 99',
    'DELETE FROM messages',
    "UPDATE topics SET serialization_format = 'json'",
    "UPDATE topics SET offered_qos_profiles = '{a: 1'",
    "UPDATE topics SET type = 'std_msgs/msg/String'",
)


def write_sqlite3_bag(folder: Path) -> Path:
    """Write a sound recording as rosbag2 does; return its `.db3` file."""
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection('/rig/slave/servo_jp', JOINT_STATE, typestore=typestore())
        for k in range(MESSAGES):
            at = k * 10**6
            writer.write(topic, at, encode_joint_state(['bend_x'], at, position=[float(k)]))
    [path] = folder.glob('*.db3')
    return path


class Sqlite3Case:
    """A recording in sqlite3 storage; no checksum tells what its bytes were."""

    def __init__(self, folder: Path) -> None:
        self._path = write_sqlite3_bag(folder / 'bag')
        self._sound = self._path.read_bytes()
        self._saved = folder / 'saved'

    def spoil(self, rng: Generator) -> None:
        self._path.write_bytes(self._sound)
        way = rng.integers(4)
        if way >= 2:
            self._path.write_bytes(spoiled_bytes(self._sound, rng))
            return
        statement = TABLES_THAT_ARE_NONE[rng.integers(len(TABLES_THAT_ARE_NONE))]
        with closing(sqlite3.connect(self._path)) as file, file:
            if way == 1:
                file.executescript(statement)
                return
            evil = EVIL_NAMES[rng.integers(len(EVIL_NAMES))]
            column = ('name', 'type', 'offered_qos_profiles')[rng.integers(3)]
            file.execute(f'UPDATE topics SET {column} = ?', (evil,))
            number = BOUNDARIES[rng.integers(len(BOUNDARIES))] % 2**63
            file.execute('UPDATE messages SET timestamp = ? WHERE id = 9', (number,))

    def read(self) -> bool:
        """Look into it and save what is sound."""
        try:
            recover(self._path, self._saved)
            open_bag(self._saved)
        except BagError as error:
            if str(error) != printable(str(error)):
                return False
        finally:
            shutil.rmtree(self._saved, ignore_errors=True)
        recording = open_bag(self._path.parent)
        str(bag_information(recording)).encode()
        return len(recording.joint_state('slave/servo_jp', finite=())) <= MESSAGES

"""The messages of one rosbag2 file in sqlite3 storage, as `mcap_scan` has those of an MCAP file.

`rosbags` reads such files too, but runs queries without bounds while it opens them, and only from
the first message to the last; an analysis goes back to the topics that it needs. Schema:
rosbag2_storage_sqlite3, versions 1 to 4.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from mcap.records import Channel, Header, Schema

from endoscope_bags.errors import BagError, BagNotFoundError, CorruptBagError, UnknownTypeError
from endoscope_bags.mcap_scan import IntArray, Messages
from endoscope_bags.message_types import message_type
from endoscope_bags.unpacking import LARGEST_CHUNK

SUFFIX = '.db3'
LIBRARY = 'rosbag2, sqlite3 storage'
_MAGIC = b'SQLite format 3\0'
_HEAD = 100
_BLOCK = 1 << 20
_LATEST = 1 << 63
# A row has a head, a number and a time beside its data; a file without rows has pages all the same.
_LEAST_ROW = 8
_FREE_ROWS = 1 << 10
# Steps of sqlite's machine: a row takes twenty at most. Crafted trees of pages could be endless.
_STEPS = 1 << 20
_FREE_STEPS, _STEPS_PER_BYTE = 1 << 26, 16
_MOST_TOPICS = (1 << 16) - 1
# What sqlite says of a damaged schema quotes it, whatever its bytes are.
_Damage = (sqlite3.Error, UnicodeDecodeError)


@dataclass
class Sqlite3Scan:
    """What one pass over a file found; fields as in `McapScan`."""

    path: Path
    header: Header = field(default_factory=lambda: Header('ros2', LIBRARY))
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: Messages = field(default_factory=lambda: Messages(*[np.empty(0, np.int64)] * 7))
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    truncated: bool = False
    # (N,), key of each message, in file order.
    row_ids: IntArray = field(default_factory=lambda: np.empty(0, np.int64))

    def block_data(self, indices: IntArray) -> Iterator[tuple[int, bytes]]:
        """Read blocks again and yield each with its index."""
        with closing(_connected(self.path)) as file:
            for index in indices.tolist():
                first, last = np.searchsorted(self.messages.block, [index, index + 1])
                keys = self.row_ids[first:last]
                query = 'SELECT data FROM messages WHERE rowid BETWEEN ? AND ? ORDER BY rowid'
                try:
                    rows = file.execute(query, (int(keys[0]), int(keys[-1]))).fetchall()
                except _Damage as error:
                    raise CorruptBagError(f'{self.path}: {error}') from error
                sizes = [len(data) if isinstance(data, bytes) else -1 for (data,) in rows]
                if sizes != self.messages.size[first:last].tolist():
                    raise CorruptBagError(f'{self.path}: changed while it was read')
                yield index, b''.join(data for (data,) in rows)


def is_sqlite3(path: Path) -> bool:
    """Tell whether a file is in sqlite3 storage, by its name or its first bytes."""
    if path.suffix == SUFFIX:
        return True
    try:
        with path.open('rb') as file:
            return file.read(len(_MAGIC)) == _MAGIC
    except OSError:
        return False


def scan_sqlite3(path: str | Path, *, salvage: bool = False) -> Sqlite3Scan:
    """Find all messages of a ``.db3`` file; `salvage` keeps those before the first damaged page."""
    path = Path(path)
    try:
        with path.open('rb') as file:
            head = file.read(_HEAD)
    except OSError as error:
        raise BagNotFoundError(f'{path}: {error.strerror}') from error
    if not head.startswith(_MAGIC):
        raise BagError(f'{path}: not an sqlite3 recording (wrong first bytes)')
    _check_length(path, head)
    scan = Sqlite3Scan(path)
    with closing(_connected(path)) as file:
        try:
            numbers = _read_topics(file, scan)
            _read_messages(file, scan, numbers, salvage)
        except _Damage as error:
            raise CorruptBagError(
                f'{path}: damaged: {error}; try `endoscope bag recover`'
            ) from error
    return scan


def _check_length(path: Path, head: bytes) -> None:
    """Refuse a file that was cut: its tables hang together by pages that are no longer there."""
    page = int.from_bytes(head[16:18]) or 1
    declared = (page if page > 1 else 1 << 16) * int.from_bytes(head[28:32])
    size = path.stat().st_size
    if len(head) < _HEAD or size < declared:
        raise CorruptBagError(
            f'{path}: ends in the middle ({size} of {declared} bytes): copy it again; of an '
            'sqlite3 recording that was cut nothing can be saved'
        )


def _connected(path: Path) -> sqlite3.Connection:
    # What a recorder that was killed has not merged yet lies in a second file.
    merged = not path.with_name(path.name + '-wal').is_file()
    address = f'{path.absolute().as_uri()}?mode=ro' + ('&immutable=1' if merged else '')
    try:
        file = sqlite3.connect(address, uri=True)
        file.text_factory = lambda text: text.decode(errors='replace')
        file.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LARGEST_CHUNK)
        for setting in ('trusted_schema = OFF', 'cell_size_check = ON', 'mmap_size = 0'):
            file.execute(f'PRAGMA {setting}')
    except _Damage as error:
        raise CorruptBagError(f'{path}: {error}') from error
    allowed = iter(range((_FREE_STEPS + _STEPS_PER_BYTE * path.stat().st_size) // _STEPS))
    file.set_progress_handler(lambda: next(allowed, None) is None, _STEPS)
    return file


def _read_topics(file: sqlite3.Connection, scan: Sqlite3Scan) -> dict[int, int]:
    """Fill schemas and channels; return the channel of each of the file's own topic numbers."""
    tables = {
        name
        for name, sql in file.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'")
        # A virtual table computes its rows.
        if str(sql).upper().startswith('CREATE TABLE')
    }
    if not {'topics', 'messages'} <= tables:
        raise BagError(f'{scan.path}: a database that is not a rosbag2 recording')
    has = {str(column[1]) for column in file.execute('PRAGMA table_info(topics)')}
    chosen = [
        name if name in has else "''" for name in ('offered_qos_profiles', 'type_description_hash')
    ]
    definitions = _definitions(file) if 'message_definitions' in tables else {}
    query = f'SELECT id, name, type, serialization_format, {", ".join(chosen)} FROM topics'
    numbers: dict[int, int] = {}
    for row in file.execute(query + f' LIMIT {_MOST_TOPICS}'):
        key, (name, kind, encoding, qos, type_hash) = row[0], map(str, row[1:])
        if not isinstance(key, int) or key in numbers:
            raise CorruptBagError(f'{scan.path}: topic {name} has the number {key!r}')
        number = numbers[key] = len(numbers) + 1
        definition = definitions.get(kind) or _known_definition(kind)
        scan.schemas[number] = Schema(
            id=number, name=kind, encoding='ros2msg', data=definition.encode()
        )
        scan.channels[number] = Channel(
            id=number,
            topic=name,
            message_encoding=encoding,
            metadata={'offered_qos_profiles': qos, 'topic_type_hash': type_hash},
            schema_id=number,
        )
    return numbers


def _definitions(file: sqlite3.Connection) -> dict[str, str]:
    query = 'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
    return {
        str(kind): str(text)
        for kind, encoding, text in file.execute(query + f' LIMIT {_MOST_TOPICS}')
        if encoding == 'ros2msg'
    }


def _known_definition(kind: str) -> str:
    try:
        return message_type(kind).definition
    except UnknownTypeError:
        return ''


def _read_messages(
    file: sqlite3.Connection, scan: Sqlite3Scan, numbers: dict[int, int], salvage: bool
) -> None:
    size = scan.path.stat().st_size
    wal = scan.path.with_name(scan.path.name + '-wal')
    size += wal.stat().st_size if wal.is_file() else 0
    what = 'rowid, topic_id, timestamp, typeof(data), length(data)'
    rows: list[tuple[int, int, int, int, int, int]] = []
    block = start = total = 0
    # Damage is found where the data are read, so that what is salvaged can be read again.
    query = f'SELECT {what}{", data" if salvage else ""} FROM messages ORDER BY rowid'
    try:
        for key, topic, timestamp, kind, length, *_ in file.execute(query):
            if kind != 'blob' or not isinstance(timestamp, int) or topic not in numbers:
                raise sqlite3.DatabaseError(f'row {key} of messages is none')
            if not 0 <= timestamp < _LATEST:
                raise sqlite3.DatabaseError(f'row {key} of messages is timed {timestamp} ns')
            total += length
            if total > size or len(rows) > _FREE_ROWS + size // _LEAST_ROW:
                raise sqlite3.DatabaseError('its tables hold more than the file')
            if start + length > _BLOCK and start:
                block, start = block + 1, 0
            rows.append((key, numbers[topic], timestamp, block, start, length))
            start += length
    except _Damage as error:
        if not salvage:
            raise
        scan.damage.append(f'after {len(rows)} messages: {error}')
    table = np.array(rows, dtype=np.int64).reshape(-1, 6)
    scan.row_ids = table[:, 0]
    scan.messages = Messages(
        channel=table[:, 1],
        # The storage numbers no messages.
        sequence=np.zeros(len(table), dtype=np.int64),
        log_ns=table[:, 2],
        publish_ns=table[:, 2],
        block=table[:, 3],
        start=table[:, 4],
        size=table[:, 5],
    )

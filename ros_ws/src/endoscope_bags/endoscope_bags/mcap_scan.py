"""The messages of one MCAP file as a table of numbers, found in one pass over its records.

The `mcap` library reads schemas, channels and chunks; only the walk over the messages is done here,
because an analysis wants a hundred thousand of them at once. The pass trusts no index, so it reads
files that were cut off, too. Format: https://mcap.dev/spec.
"""

import mmap
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile, McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Header, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream
from zstandard import ZstdError

from endoscope_bags.errors import (
    BagNotFoundError,
    CorruptBagError,
    NotABagError,
    TruncatedBagError,
)

MAGIC = b'\x89MCAP0\r\n'
_CRC_STEP = 1 << 24
_RECORD_HEAD = struct.Struct('<BQ')
MESSAGE_HEAD = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log', '<u8'),
        ('publish', '<u8'),
    ]
)

MESSAGE_HEAD_LENGTH = MESSAGE_HEAD.itemsize - _RECORD_HEAD.size

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Messages:
    """Where N messages are and what their heads say, in file order; every array is (N,) int64."""

    channel: IntArray
    sequence: IntArray
    log_ns: IntArray
    publish_ns: IntArray
    block: IntArray
    start: IntArray
    size: IntArray

    def __len__(self) -> int:
        return len(self.channel)


@dataclass
class McapScan:
    """What one pass over a file found.

    Attributes
    ----------
    path
        The file.
    header
        Its first record (profile and library).
    schemas, channels
        By their ids.
    messages
        All messages.
    blocks
        Spans ``(start, stop)`` of the file that hold messages: bodies of chunk records, and runs
        of messages outside chunks (marked by `chunked` false).
    metadata
        Metadata records by name; the last one of a name counts.
    damage
        What is wrong with the file, one line each; empty for a sound one.
    truncated
        Whether the end of the file is missing.
    """

    path: Path
    header: Header = field(default_factory=lambda: Header('', ''))
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    messages: Messages = field(default_factory=lambda: Messages(*[np.empty(0, np.int64)] * 7))
    blocks: list[tuple[int, int, bool]] = field(default_factory=list)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    damage: list[str] = field(default_factory=list)
    truncated: bool = False

    def block_data(self, indices: npt.NDArray[np.int64]) -> Iterator[tuple[int, bytes]]:
        """Read blocks again and yield each with its index, decompressed."""
        with self.path.open('rb') as file:
            for index in indices:
                start, stop, chunked = self.blocks[int(index)]
                file.seek(start)
                data = file.read(stop - start)
                yield int(index), _decompressed(data) if chunked else data


def scan_mcap(path: str | Path, *, salvage: bool = False) -> McapScan:
    """Find all messages of an MCAP file.

    Parameters
    ----------
    path
        The file.
    salvage
        Keep what is sound of a damaged file, and note the rest in `damage`, instead of raising.

    Raises
    ------
    BagNotFoundError
        There is no such file.
    NotABagError
        The file is empty or does not begin as an MCAP file.
    TruncatedBagError
        The end is missing.
    CorruptBagError
        A chunk does not agree with its checksum or does not decompress.
    """
    path = Path(path)
    if not path.is_file():
        raise BagNotFoundError(f'{path}: no such file')
    with path.open('rb') as file:
        size = path.stat().st_size
        if size == 0:
            raise NotABagError(f'{path}: empty file, not an MCAP recording')
        if file.read(len(MAGIC)) != MAGIC:
            raise NotABagError(f'{path}: not an MCAP recording (wrong first bytes)')
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
            return _Pass(path, data, salvage).run()


class _Pass:
    """State of one pass over the records of a file."""

    def __init__(self, path: Path, data: mmap.mmap, salvage: bool) -> None:
        self.scan = McapScan(path)
        self._data = data
        self._salvage = salvage
        self._heads: list[npt.NDArray[np.void]] = []
        self._starts: list[IntArray] = []
        self._blocks: list[int] = []
        self._loose: list[int] = []

    def run(self) -> McapScan:
        position = len(MAGIC)
        ended = False
        while not ended:
            record = self._record(position)
            if record is None:
                break
            opcode, start, stop = record
            if opcode == Opcode.MESSAGE and stop - start >= MESSAGE_HEAD_LENGTH:
                self._loose.append(position)
            else:
                self._end_loose_messages(position)
                self._other(opcode, start, stop)
                if opcode == Opcode.DATA_END:
                    self._check_data(position, self._data[start:stop])
                ended = opcode == Opcode.FOOTER
            position = stop
        if ended and self._data[position : position + len(MAGIC)] != MAGIC:
            self._truncated(position)
        self._end_loose_messages(position)
        self.scan.messages = self._table()
        return self.scan

    def _record(self, position: int) -> tuple[int, int, int] | None:
        start = position + _RECORD_HEAD.size
        if start <= len(self._data):
            opcode, length = _RECORD_HEAD.unpack_from(self._data, position)
            if opcode == 0:
                # A crash of the machine leaves zeros where the file had grown but was not written.
                self._truncated(position)
                return None
            if start + length <= len(self._data):
                return opcode, start, start + length
        self._truncated(position)
        return None

    def _truncated(self, position: int) -> None:
        self.scan.truncated = True
        self._damaged(
            TruncatedBagError,
            f'ends in the middle, after {position} sound bytes of {len(self._data)}',
        )

    def _damaged(self, kind: type[TruncatedBagError | CorruptBagError], what: str) -> None:
        if not self._salvage:
            raise kind(f'{self.scan.path}: {what}; try `endoscope bag recover`')
        self.scan.damage.append(what)

    def _other(self, opcode: int, start: int, stop: int) -> None:
        try:
            if opcode == Opcode.CHUNK:
                self._chunk(start, stop)
            elif opcode == Opcode.MESSAGE:
                self._damaged(CorruptBagError, f'message record at byte {start} is too short')
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.HEADER, Opcode.METADATA):
                self._describe(opcode, self._data[start:stop])
        except (EndOfFile, struct.error, UnicodeDecodeError) as error:
            name = Opcode(opcode).name.lower()
            self._damaged(
                CorruptBagError, f'{name} record at byte {start} does not decode: {error}'
            )

    def _check_data(self, end: int, body: bytes) -> None:
        expected = DataEnd.read(ReadDataStream(BytesIO(body))).data_section_crc
        actual = 0
        for start in range(0, end, _CRC_STEP):
            actual = zlib.crc32(self._data[start : min(start + _CRC_STEP, end)], actual)
        if expected not in (0, actual):
            self._damaged(CorruptBagError, 'the data do not agree with their checksum')

    def _describe(self, opcode: int, body: bytes) -> None:
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.scan.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.scan.channels[channel.id] = channel
        elif opcode == Opcode.HEADER:
            self.scan.header = Header.read(stream)
        else:
            record = Metadata.read(stream)
            self.scan.metadata[record.name] = record.metadata

    def _chunk(self, start: int, stop: int) -> None:
        try:
            records = _decompressed(self._data[start:stop])
            positions = self._message_positions(records)
        except (McapError, ValueError, RuntimeError, struct.error, ZstdError) as error:
            number = sum(chunked for _, _, chunked in self.scan.blocks) + 1
            self._damaged(CorruptBagError, f'chunk {number} at byte {start} is damaged: {error}')
            return
        self._add_block(records, positions, (start, stop, True))

    def _message_positions(self, records: bytes) -> list[int]:
        positions = []
        position = 0
        end = len(records)
        while position + _RECORD_HEAD.size <= end:
            opcode, length = _RECORD_HEAD.unpack_from(records, position)
            following = position + _RECORD_HEAD.size + length
            if following > end:
                break
            if opcode == Opcode.MESSAGE:
                _require_message_head(length)
                positions.append(position)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self._describe(opcode, records[position + _RECORD_HEAD.size : following])
            position = following
        if position != end:
            raise ValueError(f'its records end after {position} of {end} bytes')
        return positions

    def _end_loose_messages(self, stop: int) -> None:
        if not self._loose:
            return
        start = self._loose[0]
        positions = [position - start for position in self._loose]
        self._loose = []
        self._add_block(self._data[start:stop], positions, (start, stop, False))

    def _add_block(self, data: bytes, positions: list[int], span: tuple[int, int, bool]) -> None:
        self.scan.blocks.append(span)
        if not positions:
            return
        starts = np.array(positions, dtype=np.int64)
        windows = np.lib.stride_tricks.sliding_window_view(
            np.frombuffer(data, dtype=np.uint8), MESSAGE_HEAD.itemsize
        )
        self._heads.append(windows[starts].view(MESSAGE_HEAD)[:, 0])
        self._starts.append(starts + MESSAGE_HEAD.itemsize)
        self._blocks.append(len(self.scan.blocks) - 1)

    def _table(self) -> Messages:
        if not self._heads:
            return self.scan.messages
        heads = np.concatenate(self._heads)
        block = np.repeat(self._blocks, [len(starts) for starts in self._starts])
        size = heads['length'].astype(np.int64) - MESSAGE_HEAD_LENGTH
        return Messages(
            channel=heads['channel'].astype(np.int64),
            sequence=heads['sequence'].astype(np.int64),
            log_ns=heads['log'].astype(np.int64),
            publish_ns=heads['publish'].astype(np.int64),
            block=block.astype(np.int64),
            start=np.concatenate(self._starts),
            size=size,
        )


def _require_message_head(length: int) -> None:
    if length < MESSAGE_HEAD_LENGTH:
        raise ValueError(f'a message record of {length} bytes')


def _decompressed(chunk_body: bytes) -> bytes:
    chunk = Chunk.read(ReadDataStream(BytesIO(chunk_body)))
    stream, size = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(size)

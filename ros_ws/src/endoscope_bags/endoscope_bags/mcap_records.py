"""Records of an MCAP file: heads, what describes messages, chunks within limits, the summary."""

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Footer, Metadata, MetadataIndex, Schema, Statistics

LARGEST_CHUNK = 64 << 20
"""Bytes that one chunk may hold. Writers close a chunk at 0.75 MiB (C++ and so rosbag2, Rust),
1 MiB (Go, Python, TypeScript), 8 MiB (`mcap convert`) or 10 MiB (Swift); one message may exceed
that, 25 MB for an image of 3840 x 2160 in colour. This is six times the largest of them."""
FREE_BYTES, BYTES_PER_BYTE = 128 << 20, 64
"""What all chunks of a file may hold together: the first, and the second for each byte of the file.
Four topics of joint states of a rig at rest, without noise and with zstd at level 19, shrink to a
26th; behind their message index to a seventh."""
FREE_RECORDS, BYTES_PER_RECORD = 1 << 18, 2
"""Records in all chunks: the first number, and one more for so many bytes of the file. The same
joint states take 5.6 bytes each, and their message index 16 more."""
_HEAD = struct.Struct('<QQQII')
_SIZE = struct.Struct('<Q')
MAGIC = b'\x89MCAP0\r\n'
RECORD_HEAD = struct.Struct('<BQ')
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
MESSAGE_HEAD_LENGTH = MESSAGE_HEAD.itemsize - RECORD_HEAD.size
_FOOTER = RECORD_HEAD.size + 20
_CRC = 4
_LATEST_NS = 1 << 63


class ChunkError(ValueError):
    """A chunk whose content does not match its head."""


class ChunkHead(NamedTuple):
    """What stands before the data of a chunk: sizes in bytes."""

    size: int
    crc: int
    compression: bytes
    data_start: int


def chunk_head(data: object, start: int, stop: int) -> ChunkHead:
    """Read the head of the chunk whose record body is ``data[start:stop]``."""
    end = start + _HEAD.size
    if end + _SIZE.size > stop:
        raise ChunkError('its head is cut')
    _, _, size, crc, name_length = _HEAD.unpack_from(data, start)  # type: ignore[arg-type]
    data_start = end + name_length + _SIZE.size
    if data_start > stop:
        raise ChunkError('its head is cut')
    [length] = _SIZE.unpack_from(data, data_start - _SIZE.size)  # type: ignore[arg-type]
    if data_start + length != stop:
        raise ChunkError(f'its data of {length} bytes do not end where it ends')
    name = bytes(data[end : end + name_length])  # type: ignore[index]
    return ChunkHead(size, crc, name, data_start)


@dataclass
class Allowance:
    """What the chunks of a file may still hold: decompressed bytes, and records in them."""

    n_bytes: int
    n_records: int

    @classmethod
    def of(cls, file_size: int) -> 'Allowance':
        """That of a file of so many bytes."""
        return cls(
            FREE_BYTES + BYTES_PER_BYTE * file_size, FREE_RECORDS + file_size // BYTES_PER_RECORD
        )

    def take(self, n_bytes: int, n_records: int) -> None:
        """Take from it; ChunkError if there is not so much left."""
        self.n_bytes -= n_bytes
        self.n_records -= n_records
        if self.n_bytes < 0 or self.n_records < 0:
            raise ChunkError('the chunks hold more than any recorder puts in such a file')


def unpacked(body: bytes, allowance: Allowance | None = None) -> bytes:
    """Return the records in a chunk; what is decompressed for it is taken from the allowance."""
    head = chunk_head(body, 0, len(body))
    if head.size > LARGEST_CHUNK:
        raise ChunkError(
            f'it claims {head.size} bytes, at most {LARGEST_CHUNK} are read; rewrite it with '
            'smaller chunks'
        )
    if allowance is not None:
        allowance.take(0, 0)
    packed = memoryview(body)[head.data_start :]
    try:
        if head.compression == b'zstd':
            decompressor = zstandard.ZstdDecompressor(max_window_size=LARGEST_CHUNK)
            records = decompressor.stream_reader(BytesIO(packed)).read(head.size + 1)
        elif head.compression == b'lz4':
            records = lz4.frame.LZ4FrameDecompressor().decompress(packed, head.size + 1)
        elif not head.compression:
            records = bytes(packed)
        else:
            raise ChunkError(f'compression {head.compression.decode(errors="replace")} is unknown')
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise ChunkError(f'it does not decompress: {error}') from error
    if allowance is not None:
        allowance.take(len(records), 0)
    if len(records) != head.size:
        raise ChunkError(f'it does not hold the {head.size} bytes that it declares')
    if head.crc not in (0, zlib.crc32(records)):
        raise ChunkError('it does not agree with its checksum')
    return records


class ExactStream(ReadDataStream):
    """A stream of exactly one record."""

    def __init__(self, body: bytes) -> None:
        super().__init__(BytesIO(body))

    def read(self, length: int) -> bytes:
        """Read so many bytes, or raise `EndOfFile`."""
        data: bytes = super().read(length)
        if len(data) != length:
            raise EndOfFile
        return data


@dataclass
class Descriptions:
    """Schemas and channels by id, each as first described; the bytes spare reading it again."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    _bodies: dict[tuple[int, bytes], bytes] = field(default_factory=dict)

    def add(self, opcode: int, body: bytes) -> None:
        """Take a description, unless it was given before; ValueError if its id has another one."""
        key = (opcode, body[:2])
        if self._bodies.get(key) == body:
            return
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(ExactStream(body))
            same = self.schemas.setdefault(schema.id, schema) == schema
        else:
            channel = Channel.read(ExactStream(body))
            same = self.channels.setdefault(channel.id, channel) == channel
        if not same:
            raise ValueError('another description of the same id came before')
        self._bodies[key] = body


@dataclass(frozen=True)
class McapSummary:
    """Summary of a file; whether its chunks are sound is not known."""

    start_ns: int  # first and last receipt, since the epoch
    end_ns: int
    metadata: dict[str, dict[str, str]]  # by name; the last record of a name counts


def read_summary(path: Path) -> McapSummary | None:
    """Read the summary of a file; None without a sound one that counts at least one message."""
    with path.open('rb') as file:
        try:
            return _summary(file)
        except (EndOfFile, struct.error, ValueError):
            return None


def _summary(file: BinaryIO) -> McapSummary:
    """ValueError where there is none."""
    end = file.seek(0, os.SEEK_END) - len(MAGIC) - _FOOTER
    if end < len(MAGIC):
        raise ValueError('too short')
    tail = _read(file, end, _FOOTER + len(MAGIC))
    if _read(file, 0, len(MAGIC)) != MAGIC or tail[_FOOTER:] != MAGIC:
        raise ValueError('no whole MCAP file')
    footer = Footer.read(ExactStream(_body(tail[:_FOOTER], Opcode.FOOTER)))
    if not len(MAGIC) <= footer.summary_start < end:
        raise ValueError('no summary')
    summary = _read(file, footer.summary_start, end - footer.summary_start)
    covered = zlib.crc32(tail[: _FOOTER - _CRC], zlib.crc32(summary))
    if footer.summary_crc not in (0, covered):
        raise ValueError('not as it was written')
    statistics: Statistics | None = None
    indexes: list[MetadataIndex] = []
    for opcode, body in _records(summary):
        if opcode == Opcode.STATISTICS:
            statistics = Statistics.read(ExactStream(body))
        elif opcode == Opcode.METADATA_INDEX:
            indexes.append(MetadataIndex.read(ExactStream(body)))
    if statistics is None or not statistics.message_count:
        raise ValueError('no message is counted')
    first, last = statistics.message_start_time, statistics.message_end_time
    if not first <= last < _LATEST_NS or statistics.metadata_count != len(indexes):
        raise ValueError('times are impossible, or metadata without an index')
    metadata: dict[str, dict[str, str]] = {}
    for index in sorted(indexes, key=lambda each: each.offset):
        if index.offset + index.length > footer.summary_start:
            raise ValueError('metadata beyond the data')
        written = _read(file, index.offset, index.length)
        record = Metadata.read(ExactStream(_body(written, Opcode.METADATA)))
        metadata[record.name] = record.metadata
    return McapSummary(first, last, metadata)


def _read(file: BinaryIO, start: int, length: int) -> bytes:
    file.seek(start)
    data = file.read(length)
    if len(data) != length:
        raise EndOfFile
    return data


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    position = 0
    while position < len(data):
        opcode, length = RECORD_HEAD.unpack_from(data, position)
        start = position + RECORD_HEAD.size
        if start + length > len(data):
            raise EndOfFile
        yield opcode, data[start : start + length]
        position = start + length


def _body(data: bytes, wanted: Opcode) -> bytes:
    """The body of a record, which has to be of one kind."""
    opcode, body = next(_records(data), (0, b''))
    if opcode != wanted:
        raise ValueError(f'no {wanted.name} record')
    return body

"""An MCAP file being written: chunks one after another, then the summary.

The `mcap` library adds messages one by one, which costs a recorder as much as a tenth of a core and
stalls whoever shares its process while an index is written. Here a message gets its head when it
comes, and the indexes of a chunk are made as arrays, so that little is left to do at its end.
Format: https://mcap.dev/spec.
"""

import operator
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from endoscope_bags.mcap_records import MAGIC, MESSAGE_HEAD, MESSAGE_HEAD_LENGTH

# Upper bound of what a message adds to a file besides its own bytes: head and index entry.
MESSAGE_OVERHEAD = MESSAGE_HEAD.itemsize + 16
_INDEX_ENTRY = np.dtype([('time', '<u8'), ('offset', '<u8')])
_HEAD = struct.Struct('<BQHIQQ')
_LOG_NS, _CHANNEL, _RECORD = operator.itemgetter(0), operator.itemgetter(1), operator.itemgetter(3)

ChunkMessage = tuple[int, int, int, bytes]
"""log_ns, channel id, sequence, message record: in this order messages are sorted."""
_FOOTER_HEAD_AND_OFFSETS = 1 + 8 + 8 + 8


def chunk_message(
    log_ns: int, channel: int, sequence: int, publish_ns: int, data: bytes
) -> ChunkMessage:
    """Return a message, with its head, as `encode_chunk` takes it."""
    head = _HEAD.pack(
        Opcode.MESSAGE, len(data) + MESSAGE_HEAD_LENGTH, channel, sequence, log_ns, publish_ns
    )
    return log_ns, channel, sequence, head + data


@dataclass(frozen=True)
class EncodedChunk:
    """A chunk as it goes into the file."""

    chunk: bytes  # the chunk record
    indexes: bytes  # the message index records that follow it
    index: ChunkIndex  # for the summary; offsets relative to the beginning of the chunk record
    counts: dict[int, int]  # messages by channel


def encode_chunk(messages: Sequence[ChunkMessage]) -> EncodedChunk:
    """Sort messages (at least one) by receipt and make a zstd chunk with checksum of them."""
    messages = sorted(messages)
    n = len(messages)
    log_ns = np.fromiter(map(_LOG_NS, messages), np.int64, n)
    channel = np.fromiter(map(_CHANNEL, messages), np.int64, n)
    parts = list(map(_RECORD, messages))
    size = np.fromiter(map(len, parts), np.int64, n)
    records = b''.join(parts)
    body = Chunk(
        compression='zstd',
        data=zstandard.compress(records),
        message_start_time=int(log_ns[0]),
        message_end_time=int(log_ns[-1]),
        uncompressed_crc=zlib.crc32(records),
        uncompressed_size=len(records),
    )
    builder = RecordBuilder()
    body.write(builder)
    chunk = builder.end()
    by_channel = np.argsort(channel, kind='stable')
    entries = np.empty(n, dtype=_INDEX_ENTRY)
    entries['time'] = log_ns[by_channel]
    entries['offset'] = (np.cumsum(size) - size)[by_channel]
    entry_bytes = entries.tobytes()
    channels, each = np.unique(channel, return_counts=True)
    counts = dict(zip(channels.tolist(), each.tolist(), strict=True))
    indexes: list[bytes] = []
    positions: dict[int, int] = {}
    position, begin = len(chunk), 0
    for identifier, count in counts.items():
        end = begin + count * _INDEX_ENTRY.itemsize
        positions[identifier] = position
        indexes.append(_message_index(identifier, entry_bytes[begin:end]))
        position += len(indexes[-1])
        begin = end
    return EncodedChunk(
        chunk,
        b''.join(indexes),
        ChunkIndex(
            message_start_time=body.message_start_time,
            message_end_time=body.message_end_time,
            chunk_start_offset=0,
            chunk_length=len(chunk),
            message_index_offsets=positions,
            message_index_length=position - len(chunk),
            compression='zstd',
            compressed_size=len(body.data),
            uncompressed_size=body.uncompressed_size,
        ),
        counts,
    )


def _message_index(channel: int, entries: bytes) -> bytes:
    head = struct.pack('<BQHI', Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries))
    return head + entries


class McapFile:
    """Writes the records around chunks, with checksums, and the summary to an unbuffered stream."""

    def __init__(self, stream: BinaryIO, library: str) -> None:
        self._stream = stream
        self.position = 0  # bytes of all records that were written whole
        self._crc = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._chunks: list[ChunkIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._counts: dict[int, int] = {}
        self._write(MAGIC + _encoded(Header(profile='ros2', library=library)))

    def add_schema(self, name: str, definition: str) -> Schema:
        """Write a `ros2msg` schema outside the chunks, so that no damaged one takes it along."""
        schema = Schema(
            id=len(self._schemas) + 1, name=name, encoding='ros2msg', data=definition.encode()
        )
        self._write(_encoded(schema))
        self._schemas.append(schema)
        return schema

    def add_channel(self, channel: Channel) -> None:
        """Write a channel."""
        self._write(_encoded(channel))
        self._channels.append(channel)

    def add_chunk(self, encoded: EncodedChunk) -> None:
        """Write a chunk and its indexes."""
        start = self.position
        self._write(encoded.chunk + encoded.indexes)
        index = encoded.index
        offsets = {k: start + offset for k, offset in index.message_index_offsets.items()}
        self._chunks.append(replace(index, chunk_start_offset=start, message_index_offsets=offsets))
        for channel, count in encoded.counts.items():
            self._counts[channel] = self._counts.get(channel, 0) + count

    def add_metadata(self, name: str, content: dict[str, str]) -> None:
        """Write a metadata record."""
        data = _encoded(Metadata(name=name, metadata=content))
        self._metadata.append(MetadataIndex(offset=self.position, length=len(data), name=name))
        self._write(data)

    def finish(self) -> None:
        """Write the end of the data, the summary and the footer. The stream stays open."""
        self._write(_encoded(DataEnd(data_section_crc=self._crc)))
        start = self.position
        groups: list[tuple[Opcode, list[McapRecord]]] = [
            (Opcode.SCHEMA, list(self._schemas)),
            (Opcode.CHANNEL, list(self._channels)),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
            (Opcode.METADATA_INDEX, list(self._metadata)),
        ]
        summary = b''
        offsets = b''
        for opcode, records in groups:
            if not records:
                continue
            data = b''.join(_encoded(record) for record in records)
            offset = SummaryOffset(
                group_opcode=opcode, group_start=start + len(summary), group_length=len(data)
            )
            offsets += _encoded(offset)
            summary += data
        footer = Footer(
            summary_start=start, summary_offset_start=start + len(summary), summary_crc=0
        )
        covered = summary + offsets + _encoded(footer)[:_FOOTER_HEAD_AND_OFFSETS]
        footer = replace(footer, summary_crc=zlib.crc32(covered))
        self._write(summary + offsets + _encoded(footer) + MAGIC)

    def _statistics(self) -> Statistics:
        return Statistics(
            message_count=sum(self._counts.values()),
            schema_count=len(self._schemas),
            channel_count=len(self._channels),
            attachment_count=0,
            metadata_count=len(self._metadata),
            chunk_count=len(self._chunks),
            message_start_time=min((c.message_start_time for c in self._chunks), default=0),
            message_end_time=max((c.message_end_time for c in self._chunks), default=0),
            channel_message_counts=self._counts,
        )

    def _write(self, data: bytes) -> None:
        remaining = memoryview(data)
        while remaining:
            remaining = remaining[self._stream.write(remaining) :]
        self.position += len(data)
        self._crc = zlib.crc32(data, self._crc)


def _encoded(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    data: bytes = builder.end()
    return data

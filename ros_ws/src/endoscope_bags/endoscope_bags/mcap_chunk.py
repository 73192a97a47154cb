"""One MCAP chunk with its message indexes, built from many messages at once.

The `mcap` library adds messages one by one, which costs a recorder as much as a tenth of a core and
stalls whoever shares its process while an index is written. Here a message gets its head when it
comes, and the indexes of a chunk are made as arrays, so that little is left to do at its end.
Format: https://mcap.dev/spec.
"""

import operator
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Chunk, ChunkIndex

from endoscope_bags.mcap_records import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH

# Upper bound of what a message adds to a file besides its own bytes: head and index entry.
MESSAGE_OVERHEAD = MESSAGE_HEAD.itemsize + 16
_INDEX_ENTRY = np.dtype([('time', '<u8'), ('offset', '<u8')])
_HEAD = struct.Struct('<BQHIQQ')
_LOG_NS, _CHANNEL, _RECORD = operator.itemgetter(0), operator.itemgetter(1), operator.itemgetter(3)

ChunkMessage = tuple[int, int, int, bytes]
"""log_ns, channel id, sequence, message record: in this order messages are sorted."""


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

"""One MCAP chunk with its message indexes, built from many messages at once.

The `mcap` library adds messages one by one, which costs a recorder as much as a tenth of a core and
stalls whoever shares its process while an index is written; here the heads and the indexes of all
messages of a chunk are made as arrays. Format: https://mcap.dev/spec.
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

from endoscope_bags.mcap_scan import MESSAGE_HEAD, MESSAGE_HEAD_LENGTH

# Upper bound of what a message adds to a file besides its own bytes: head and index entry.
MESSAGE_OVERHEAD = MESSAGE_HEAD.itemsize + 16
_INDEX_ENTRY = np.dtype([('time', '<u8'), ('offset', '<u8')])
_COLUMNS = tuple(operator.itemgetter(k) for k in range(5))

ChunkMessage = tuple[int, int, int, int, bytes]
"""log_ns, channel id, sequence, publish_ns, data: in this order messages are sorted."""


@dataclass(frozen=True)
class EncodedChunk:
    """A chunk as it goes into the file.

    Attributes
    ----------
    chunk, indexes
        The chunk record, and the message index records that follow it.
    index
        Its entry for the summary, with offsets relative to the beginning of the chunk record.
    counts
        Messages by channel.
    """

    chunk: bytes
    indexes: bytes
    index: ChunkIndex
    counts: dict[int, int]


def encode_chunk(messages: Sequence[ChunkMessage]) -> EncodedChunk:
    """Sort messages (at least one) by receipt and make a zstd chunk with checksum of them."""
    messages = sorted(messages)
    log_ns, channel, sequence, publish_ns, data = (list(map(get, messages)) for get in _COLUMNS)
    heads = np.empty(len(messages), dtype=MESSAGE_HEAD)
    size = np.fromiter(map(len, data), dtype=np.int64, count=len(data))
    heads['opcode'] = Opcode.MESSAGE
    heads['length'] = size + MESSAGE_HEAD_LENGTH
    heads['channel'] = channel
    heads['sequence'] = sequence
    heads['log'] = log_ns
    heads['publish'] = publish_ns
    offsets = np.cumsum(size + MESSAGE_HEAD.itemsize) - size - MESSAGE_HEAD.itemsize
    records = b''.join(_interleaved(heads.tobytes(), data))
    body = Chunk(
        compression='zstd',
        data=zstandard.compress(records),
        message_start_time=log_ns[0],
        message_end_time=log_ns[-1],
        uncompressed_crc=zlib.crc32(records),
        uncompressed_size=len(records),
    )
    builder = RecordBuilder()
    body.write(builder)
    chunk = builder.end()
    indexes: list[bytes] = []
    counts: dict[int, int] = {}
    positions: dict[int, int] = {}
    position = len(chunk)
    for identifier in dict.fromkeys(channel):
        rows = heads['channel'] == identifier
        entries = np.empty(int(rows.sum()), dtype=_INDEX_ENTRY)
        entries['time'] = heads['log'][rows]
        entries['offset'] = offsets[rows]
        positions[identifier] = position
        counts[identifier] = len(entries)
        indexes.append(_message_index(identifier, entries.tobytes()))
        position += len(indexes[-1])
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


def _interleaved(heads: bytes, data: Sequence[bytes]) -> list[bytes]:
    size = MESSAGE_HEAD.itemsize
    parts: list[bytes] = [b''] * (2 * len(data))
    parts[0::2] = [heads[k : k + size] for k in range(0, len(heads), size)]
    parts[1::2] = data
    return parts


def _message_index(channel: int, entries: bytes) -> bytes:
    head = struct.pack('<BQHI', Opcode.MESSAGE_INDEX, 6 + len(entries), channel, len(entries))
    return head + entries

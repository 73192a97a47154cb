"""Decompression of MCAP chunks, within limits that any genuine recording keeps."""

import struct
import zlib
from dataclasses import dataclass
from io import BytesIO
from typing import NamedTuple

import lz4.frame
import zstandard

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

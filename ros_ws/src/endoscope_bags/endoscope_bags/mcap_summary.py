"""Time span and metadata of an MCAP file, from the summary at its end."""

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Footer, Metadata, MetadataIndex, Statistics

from endoscope_bags.mcap_records import MAGIC, RECORD_HEAD, ExactStream

_FOOTER = RECORD_HEAD.size + 20
_CRC = 4
_LATEST_NS = 1 << 63


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

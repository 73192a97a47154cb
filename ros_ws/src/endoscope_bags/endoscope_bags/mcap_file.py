"""An MCAP file being written: chunks one after another, then the summary."""

import zlib
from dataclasses import replace
from typing import BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
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

from endoscope_bags.mcap_chunk import EncodedChunk
from endoscope_bags.mcap_records import MAGIC

_FOOTER_HEAD_AND_OFFSETS = 1 + 8 + 8 + 8


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

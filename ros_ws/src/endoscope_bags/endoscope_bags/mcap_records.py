"""Records of an MCAP file one by one: their heads, and what describes messages."""

import struct
from dataclasses import dataclass, field
from io import BytesIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

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

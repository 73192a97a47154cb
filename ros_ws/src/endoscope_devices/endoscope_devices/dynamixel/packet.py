"""Packets of Dynamixel Protocol 2.0: framing, byte stuffing and CRC, both ways.

Source: ROBOTIS e-manual, 'DYNAMIXEL Protocol 2.0', sections 'Instruction Packet', 'Status Packet',
'Processing order of Packet (byte stuffing)', 'Fast Sync Read', and 'CRC Calculation' (polynomial
0x8005, initial value 0, most significant bit first).
"""

from enum import IntEnum
from typing import NamedTuple

HEADER = b'\xff\xff\xfd\x00'
BROADCAST_ID = 0xFE
LARGEST_ID = 0xFC
LARGEST_LENGTH = 1024
STATUS = 0x55

# Header, id, two bytes of length; instruction, and two bytes of CRC that the length counts.
PREFIX_SIZE = 7
CRC_SIZE = 2
STATUS_OVERHEAD = 11

_STUFFED = b'\xff\xff\xfd\xfd'
_BARE = b'\xff\xff\xfd'


class Instruction(IntEnum):
    """Instructions that are used here."""

    PING = 0x01
    READ = 0x02
    WRITE = 0x03
    REBOOT = 0x08
    SYNC_READ = 0x82
    SYNC_WRITE = 0x83


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x8005) & 0xFFFF if crc & 0x8000 else crc << 1
        table.append(crc)
    return tuple(table)


_TABLE = _crc_table()


def crc16(data: bytes) -> int:
    """CRC of all bytes before it."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFF00) ^ _TABLE[crc >> 8 ^ byte]
    return crc


def encode(device: int, instruction: int, parameters: bytes = b'') -> bytes:
    """Make a packet, stuffed, an error byte first in `parameters`; ValueError if too long."""
    body = bytes((instruction,)) + parameters.replace(_BARE, _STUFFED)
    length = len(body) + CRC_SIZE
    if length > LARGEST_LENGTH:
        raise ValueError(f'a packet of {length} bytes is longer than {LARGEST_LENGTH}')
    packet = HEADER + bytes((device, length & 0xFF, length >> 8)) + body
    return packet + crc16(packet).to_bytes(CRC_SIZE, 'little')


class Packet(NamedTuple):
    """A packet whose CRC is right."""

    device: int
    instruction: int  # ``STATUS`` for an answer
    parameters: bytes  # unstuffed
    size: int  # bytes on the wire


class PacketReader:
    """Finds packets in a stream of bytes that may be damaged in any way."""

    def __init__(self) -> None:
        self.wrong_crc = 0  # packets dropped for their CRC or their stuffing
        self._buffer = bytearray()

    def clear(self) -> None:
        """Forget the bytes of an unfinished packet."""
        self._buffer.clear()

    def feed(self, data: bytes) -> list[Packet]:
        """Take bytes and give the packets that are complete now."""
        self._buffer += data
        found = []
        while (packet := self._next()) is not None:
            found.append(packet)
        return found

    def _next(self) -> Packet | None:
        buffer = self._buffer
        while True:
            start = buffer.find(HEADER)
            if start < 0:
                # The end may be the beginning of a header.
                keep = next((k for k in (3, 2, 1) if buffer.endswith(HEADER[:k])), 0)
                del buffer[: len(buffer) - keep]
                return None
            del buffer[:start]
            if len(buffer) < PREFIX_SIZE:
                return None
            length = buffer[5] | buffer[6] << 8
            if not 1 + CRC_SIZE <= length <= LARGEST_LENGTH:
                del buffer[:1]
                continue
            size = PREFIX_SIZE + length
            if len(buffer) < size:
                return None
            raw = bytes(buffer[:size])
            body = raw[PREFIX_SIZE:-CRC_SIZE]
            right = crc16(raw[:-CRC_SIZE]) == int.from_bytes(raw[-CRC_SIZE:], 'little')
            if not right or body.count(_BARE) != body.count(_STUFFED):
                self.wrong_crc += 1
                del buffer[:1]
                continue
            del buffer[:size]
            return Packet(raw[4], body[0], body[1:].replace(_STUFFED, _BARE), size)

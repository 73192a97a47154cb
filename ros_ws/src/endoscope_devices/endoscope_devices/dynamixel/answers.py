"""Takes from a stream of bytes the answers to one request, and nothing else."""

from collections.abc import Sequence
from typing import NamedTuple

from endoscope_devices.dynamixel.control_table import ALERT
from endoscope_devices.dynamixel.packet import (
    BROADCAST_ID,
    STATUS,
    Packet,
    PacketReader,
    split_fast_answer,
)


class Reply(NamedTuple):
    """What a servo answered."""

    error: int  # error byte; the alert bit alone is no refusal
    data: bytes  # parameters after the error byte


class AnswerCollector:
    """Matches packets with the open request by kind, id, order and length; `fast`: all in one."""

    def __init__(self, devices: Sequence[int], size: int, fast: bool = False) -> None:
        self.replies: dict[int, Reply] = {}
        # Valid packets that answer no open question: late, repeated, or of another servo.
        self.stray = 0
        self.reader = PacketReader()
        self._devices = tuple(devices)
        self._size = size  # data bytes of each answer
        self._fast = fast

    @property
    def complete(self) -> bool:
        """Whether all have answered."""
        return len(self.replies) == len(self._devices)

    def feed(self, data: bytes) -> None:
        """Take bytes from the line."""
        for packet in self.reader.feed(data):
            reply = self._reply(packet)
            if reply is None:
                self.stray += 1
            else:
                self.replies |= reply

    def _reply(self, packet: Packet) -> dict[int, Reply] | None:
        if packet.instruction != STATUS or self.complete:
            return None
        if self._fast and packet.device == BROADCAST_ID:
            parts = split_fast_answer(packet, self._size)
            if tuple(parts) == self._devices:
                return {device: Reply(*part) for device, part in parts.items()}
            return None
        expected = packet.device == self._devices[len(self.replies)]
        if not expected or not packet.parameters:
            return None
        error, data = packet.parameters[0], packet.parameters[1:]
        # A refusal carries no data, whatever was asked for.
        if len(data) == self._size or (not data and error & ~ALERT):
            return {packet.device: Reply(error, data)}
        return None

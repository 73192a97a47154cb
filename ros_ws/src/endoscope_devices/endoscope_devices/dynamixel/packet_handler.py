"""Requests and answers on the bus, each answer matched to its request.

What differs from the SDK's packet handler: requests are stuffed, an answer is taken by id, kind and
length after the line was emptied, each servo's error byte is kept, and the time-out is the time on
the wire plus a margin instead of 34 ms of busy waiting. An answer does not name its register, so no
two reads of single servos in a row request the same number of bytes: a repeated answer to the first
is then none to the second.
"""

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from endoscope_devices.device import DeviceError
from endoscope_devices.dynamixel.control_table import (
    ALERT,
    RETURN_DELAY_UNIT,
    Register,
    error_in_words,
)
from endoscope_devices.dynamixel.packet import (
    BROADCAST_ID,
    LARGEST_ID,
    STATUS,
    STATUS_OVERHEAD,
    Instruction,
    Packet,
    PacketReader,
    encode,
)
from endoscope_devices.dynamixel.serial_port import BusPort, byte_time, latency_timer

REPLY_MARGIN_S = 3e-3
QUIET_S = 0.03
# Nobody moves while a single servo is asked: patience costs nothing there.
SINGLE_MARGIN_S = 0.02
_ATTEMPTS = 3
_PING_SIZE = 3
_PING_PAUSE_S = 3e-3
_LONGEST_RETURN_DELAY_S = 254 * RETURN_DELAY_UNIT


class Reply(NamedTuple):
    """Answer of a servo."""

    error: int  # error byte; the alert bit alone is no refusal
    data: bytes  # parameters after the error byte


class AnswerCollector:
    """Matches packets with the open request by kind, id, order and length."""

    def __init__(self, devices: Sequence[int], size: int) -> None:
        self.replies: dict[int, Reply] = {}
        # Valid packets that answer no open question: late, repeated, or of another servo.
        self.stray = 0
        self.reader = PacketReader()
        self._devices = tuple(devices)
        self._size = size  # data bytes of each answer

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
        expected = packet.device == self._devices[len(self.replies)]
        if not expected or not packet.parameters:
            return None
        error, data = packet.parameters[0], packet.parameters[1:]
        # A refusal carries no data, whatever was asked for.
        if len(data) == self._size or (not data and error & ~ALERT):
            return {packet.device: Reply(error, data)}
        return None


class BusError(DeviceError):
    """A servo did not carry out a request; the message names it."""


class NoReplyError(BusError):
    """No valid answer came in time."""


@dataclass
class BusCounts:
    """Counters of the bus."""

    requests: int = 0  # that want an answer
    answers: int = 0  # taken
    missing: int = 0  # answers that did not come in time
    stray: int = 0  # valid packets that answer no open request: late, repeated, or of another servo
    damaged: int = 0  # packets dropped for their CRC


@dataclass
class PacketHandler:
    """Protocol 2.0 on an open port."""

    port: BusPort
    margin: float = REPLY_MARGIN_S  # s granted to an answer beyond its time on the wire
    counts: BusCounts = field(default_factory=BusCounts)
    # Of the servos in s, as far as known; the largest there is until then.
    return_delay: float = _LONGEST_RETURN_DELAY_S
    _size_before: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self.margin += latency_timer(self.port.port_name) or 0.0

    def time_out(self, sent: int, answers: Sequence[int]) -> float:
        """Time in s for `sent` bytes of request and for answers of so many data bytes each."""
        on_the_wire = sent + sum(STATUS_OVERHEAD + size for size in answers)
        return (
            on_the_wire * byte_time(self.port.baudrate)
            + self.return_delay * len(answers)
            + self.margin
        )

    def drain(self, quiet: float) -> None:
        """Discard what still arrives until the line is quiet for `quiet` s, or ten times that."""
        latest = time.monotonic() + 10.0 * quiet
        while self.port.receive(time.monotonic() + quiet) and time.monotonic() < latest:
            pass

    def ping(self, device: int) -> tuple[int, int]:
        """Model number and firmware version of a servo; NoReplyError where it does not answer."""
        reply = self._ask(device, Instruction.PING, b'', _PING_SIZE)
        return reply.data[0] | reply.data[1] << 8, reply.data[2]

    def read(self, device: int, address: int, size: int) -> Reply:
        """Read `size` bytes of a control table; BusError on its error, NoReplyError on silence."""
        asked = size + 1 if size == self._size_before else size
        reply = self._ask(device, Instruction.READ, _words(address, asked), asked)
        return Reply(reply.error, reply.data[:size])

    def write(self, device: int, address: int, data: bytes) -> None:
        """Write to a servo's control table; BusError on its error, NoReplyError on silence."""
        self._ask(device, Instruction.WRITE, _words(address) + data, 0)

    def reboot(self, device: int) -> None:
        """Restart a servo: all of RAM is lost and torque is off. Raises as :meth:`write` does."""
        self._ask(device, Instruction.REBOOT, b'', 0, attempts=1)

    def read_register(self, device: int, register: Register) -> int:
        """Value of a register in counts; see :meth:`read`."""
        return register.decode(self.read(device, register.address, register.size).data)

    def write_register(self, device: int, register: Register, counts: int) -> None:
        """Set a register, in counts; see :meth:`write`."""
        self.write(device, register.address, register.encode(counts))

    def _ask(
        self,
        device: int,
        instruction: Instruction,
        parameters: bytes,
        size: int,
        attempts: int = _ATTEMPTS,
    ) -> Reply:
        request = encode(device, instruction, parameters)
        what = f'servo {device} on {self.port.port_name}'
        self._size_before = size
        for _ in range(attempts):
            reply = self.transact(request, [device], size, margin=SINGLE_MARGIN_S).get(device)
            if reply is None:
                self.drain(QUIET_S)
                continue
            if reply.error & ~ALERT:
                raise BusError(
                    f'{what} refuses {instruction.name.lower()} of {parameters.hex(" ")}: '
                    f'{error_in_words(reply.error)}'
                )
            return reply
        raise NoReplyError(
            f'{what} does not answer at {self.port.baudrate} baud; check power and cable, or '
            'look for it with `endoscope doctor`'
        )

    def transact(
        self,
        request: bytes,
        devices: Sequence[int],
        size: int,
        margin: float = 0.0,
    ) -> dict[int, Reply]:
        """Send packets; answers to the last by id, of `size` bytes, as far as they came in time.

        Servos answer in the order of `devices`; `margin` is in s. OSError without an adapter.
        """
        port = self.port
        port.clearPort()
        port.send(request)
        deadline = time.monotonic() + self.time_out(len(request), [size] * len(devices)) + margin
        self.counts.requests += len(devices)
        collector = AnswerCollector(devices, size)
        in_time = True
        while in_time and not collector.complete:
            in_time = time.monotonic() < deadline
            data = port.receive(deadline)
            if not data:
                break
            collector.feed(data)
        self.counts.answers += len(collector.replies)
        self.counts.missing += len(devices) - len(collector.replies)
        self.counts.stray += collector.stray
        self.counts.damaged += collector.reader.wrong_crc
        return collector.replies

    def broadcast_ping(self) -> dict[int, tuple[int, int]]:
        """Model number and firmware version by id of every servo on the line, 3 ms an id."""
        self.port.clearPort()
        self.port.send(encode(BROADCAST_ID, Instruction.PING))
        deadline = time.monotonic() + self.margin + _PING_PAUSE_S * (LARGEST_ID + 1)
        reader = PacketReader()
        found: dict[int, tuple[int, int]] = {}
        while time.monotonic() < deadline:
            for packet in reader.feed(self.port.receive(deadline)):
                data = packet.parameters
                if packet.instruction == STATUS and len(data) == 1 + _PING_SIZE:
                    found[packet.device] = (data[1] | data[2] << 8, data[3])
        return found


def sync_read_request(address: int, size: int, devices: Sequence[int]) -> bytes:
    """Bytes that make several servos answer, in order of `devices`, with the same registers."""
    return encode(BROADCAST_ID, Instruction.SYNC_READ, _words(address, size) + bytes(devices))


def sync_write_request(address: int, size: int, data: Mapping[int, bytes]) -> bytes:
    """Bytes that set the same registers, `data` by id, of several servos, which do not answer."""
    parameters = _words(address, size)
    for device, value in data.items():
        if not 0 <= device <= LARGEST_ID or len(value) != size:
            raise ValueError(f'{len(value)} bytes for servo {device} in a sync write of {size}')
        parameters += bytes((device,)) + value
    return encode(BROADCAST_ID, Instruction.SYNC_WRITE, parameters)


def _words(*values: int) -> bytes:
    return b''.join(value.to_bytes(2, 'little') for value in values)

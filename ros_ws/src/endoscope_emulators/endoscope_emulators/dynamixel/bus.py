"""Emulated servos on a pseudo-terminal, with the delays of a real line."""

import ctypes
import fcntl
import heapq
import itertools
import os
import select
import struct
import threading
import time
import tty
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from endoscope_core.exit_status import ClosedOnExit
from endoscope_devices.dynamixel import control_table as table
from endoscope_devices.dynamixel.control_table import BAUD_CODES, RETURN_DELAY_UNIT
from endoscope_devices.dynamixel.packet import (
    BROADCAST_ID,
    STATUS,
    Instruction,
    Packet,
    PacketReader,
    encode,
)
from endoscope_devices.dynamixel.serial_port import byte_time
from endoscope_emulators.dynamixel.control_table import BAUD_RATE, ID
from endoscope_emulators.dynamixel.faults import LineFaults
from endoscope_emulators.dynamixel.servo import EmulatedServo, ErrorNumber

# Linux: termios with the speeds as numbers (asm-generic/ioctls.h), and the slack of timers.
_TCGETS2 = 0x802C542A
_PR_SET_TIMERSLACK = 29
_SLACK_NS = 1000
_IDLE_S = 5e-3


class EmulatedBus(ClosedOnExit):
    """A line with servos, served by a thread.

    Bytes take their time at the line's speed, both ways; a servo that is set to another speed
    receives nothing. The path `link` leads to the terminal while it is plugged in, as udev's do.
    """

    def __init__(self, servos: Sequence[EmulatedServo], link: Path | None = None) -> None:
        self.servos = {servo.value(ID): servo for servo in servos}
        self.faults = LineFaults()  # in force; change them inside :meth:`paused`
        self._link = link
        self._lock = threading.RLock()
        self._reader = PacketReader()
        self._events: list[tuple[float, int, Packet | bytes]] = []
        self._order = itertools.count()
        self._line_free = 0.0
        self._master = -1
        self._slave = -1
        self._terminal = ''
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name='emulated bus', daemon=True)
        self.plug_in()

    @property
    def port(self) -> str:
        """Device file for the client."""
        return self._terminal if self._link is None else str(self._link)

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """End, and take the terminal away."""
        self._stopping = True
        os.write(self._wake_write, b'x')
        self._thread.join()
        self.hang_up()
        os.close(self._wake_read)
        os.close(self._wake_write)

    def __enter__(self) -> Self:
        self.start()
        return self

    @contextmanager
    def paused(self) -> Iterator[LineFaults]:
        """Lock the thread out while faults or servos are changed or inspected."""
        with self._lock:
            now = time.monotonic()
            for servo in self.servos.values():
                servo.advance(now)
            yield self.faults

    def plug_in(self) -> None:
        """Make a new terminal, as an adapter that is plugged in does."""
        with self._lock:
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self._terminal = os.ttyname(self._slave)
            if self._link is not None:
                self._link.unlink(missing_ok=True)
                self._link.symlink_to(self._terminal)
        os.write(self._wake_write, b'x')

    def hang_up(self) -> None:
        """Take the terminal away, as an adapter that is pulled out does."""
        with self._lock:
            if self._master < 0:
                return
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1
            self._reader.clear()
            self._events.clear()
            if self._link is not None:
                self._link.unlink(missing_ok=True)

    def restart(self, device: int) -> None:
        """Restart a servo, as after a short loss of power."""
        with self.paused():
            self.servos[device].restart(time.monotonic())

    def supply(self, device: int, volts: float) -> None:
        """Change a servo's voltage in V; below 6 V it is off, and restarts when that is over."""
        with self.paused():
            servo = self.servos[device]
            was_off = servo.supply <= 0.0
            servo.supply = volts if volts >= 6.0 else 0.0
            if was_off and servo.supply > 0.0:
                servo.restart(time.monotonic())

    def overload(self, device: int) -> None:
        """Make a servo detect an overload."""
        with self.paused():
            self.servos[device].overload()

    def _run(self) -> None:
        ctypes.CDLL(None).prctl(_PR_SET_TIMERSLACK, _SLACK_NS, 0, 0, 0)
        while not self._stopping:
            with self._lock:
                master = self._master
                due = self._events[0][0] if self._events else float('inf')
            wait = min(_IDLE_S, max(0.0, due - time.monotonic()))
            watched = [self._wake_read] + ([master] if master >= 0 else [])
            try:
                ready, _, _ = select.select(watched, [], [], wait)
            except OSError:
                # The terminal was taken away while it was waited for.
                continue
            if self._wake_read in ready:
                os.read(self._wake_read, 64)
            with self._lock:
                if master in ready and master == self._master:
                    self._hear(master)
                self._do_what_is_due()

    def _hear(self, master: int) -> None:
        now = time.monotonic()
        try:
            data = os.read(master, 4096)
        except OSError:
            return
        per_byte = byte_time(self._line_speed())
        begin = max(now, self._line_free)
        self._line_free = begin + len(data) * per_byte
        before = 0
        for packet in self._reader.feed(self.faults.damaged(data)):
            before += packet.size
            self._schedule(begin + before * per_byte, packet)

    def _line_speed(self) -> int:
        """Speed that the client has set, in baud."""
        buffer = bytearray(64)
        fcntl.ioctl(self._master, _TCGETS2, buffer)
        return max(1, struct.unpack_from('4Ix19x2I', buffer)[-1])

    def _schedule(self, when: float, what: Packet | bytes) -> None:
        heapq.heappush(self._events, (when, next(self._order), what))

    def _do_what_is_due(self) -> None:
        now = time.monotonic()
        for servo in self.servos.values():
            servo.advance(now)
        while self._events and self._events[0][0] <= now:
            when, _, what = heapq.heappop(self._events)
            if isinstance(what, bytes):
                self._deliver(what)
            else:
                self._execute(what, when)

    def _deliver(self, data: bytes) -> None:
        try:
            os.write(self._master, data)
        except BlockingIOError:
            # Nobody reads: a serial port loses such bytes too.
            return

    def _execute(self, packet: Packet, now: float) -> None:
        speed = self._line_speed()
        hearing = [
            servo
            for device, servo in self.servos.items()
            if device not in self.faults.silent
            and servo.answers(now)
            and BAUD_CODES[servo.value(BAUD_RATE)] == speed
        ]
        for servo in hearing:
            if packet.device in (BROADCAST_ID, servo.value(ID)):
                servo.hear(now)
        line = max(now, self._line_free)
        for servo, answer in self._answers(packet, hearing, now):
            line += servo.value(table.RETURN_DELAY_TIME) * RETURN_DELAY_UNIT
            line += len(answer) * byte_time(speed)
            for _ in range(self.faults.repeats()):
                self._schedule(line + self.faults.delay(), self.faults.damaged(answer))
        self._line_free = line

    def _answers(
        self, packet: Packet, hearing: Sequence[EmulatedServo], now: float
    ) -> Iterator[tuple[EmulatedServo, bytes]]:
        words = packet.parameters
        if packet.instruction == Instruction.SYNC_READ:
            yield from self._sync_read(packet, hearing)
        elif packet.instruction == Instruction.SYNC_WRITE:
            size = int.from_bytes(words[2:4], 'little')
            for start in range(4, len(words), 1 + size):
                for servo in hearing:
                    if servo.value(ID) == words[start]:
                        servo.write(
                            int.from_bytes(words[:2], 'little'),
                            words[start + 1 : start + 1 + size],
                        )
        else:
            for servo in sorted(hearing, key=lambda one: one.value(ID)):
                device = servo.value(ID)
                if packet.device == device:
                    level = servo.value(table.STATUS_RETURN_LEVEL)
                    error, data = self._single(packet, servo, now)
                    if packet.instruction in _ALWAYS_ANSWERED or level == 2:
                        yield servo, _status(servo, error, data)
                elif packet.device == BROADCAST_ID and packet.instruction == Instruction.PING:
                    yield servo, _status(servo, *self._single(packet, servo, now))

    def _single(
        self, packet: Packet, servo: EmulatedServo, now: float
    ) -> tuple[ErrorNumber, bytes]:
        words = packet.parameters
        address = int.from_bytes(words[:2], 'little')
        if packet.instruction == Instruction.PING:
            return servo.read(table.MODEL_NUMBER.address, 2)[0], (
                servo.read(table.MODEL_NUMBER.address, 2)[1]
                + servo.read(table.FIRMWARE_VERSION.address, 1)[1]
            )
        if packet.instruction == Instruction.READ and len(words) == 4:
            return servo.read(address, int.from_bytes(words[2:], 'little'))
        if packet.instruction == Instruction.WRITE and len(words) > 2:
            return servo.write(address, words[2:]), b''
        if packet.instruction == Instruction.REBOOT:
            servo.restart(now)
            return ErrorNumber.NONE, b''
        return ErrorNumber.INSTRUCTION, b''

    @staticmethod
    def _sync_read(
        packet: Packet, hearing: Sequence[EmulatedServo]
    ) -> Iterator[tuple[EmulatedServo, bytes]]:
        words = packet.parameters
        address, size = (int.from_bytes(words[k : k + 2], 'little') for k in (0, 2))
        here = {servo.value(ID): servo for servo in hearing}
        for device in words[4:]:
            if device not in here:
                # Each servo answers after the one before it in the list.
                return
            servo = here[device]
            error, data = servo.read(address, size)
            yield servo, _status(servo, error, data)


_ALWAYS_ANSWERED = (Instruction.PING, Instruction.READ)


def _status(servo: EmulatedServo, error: ErrorNumber, data: bytes) -> bytes:
    head = bytes((error | servo.alert(),))
    return encode(servo.value(ID), STATUS, head + data)

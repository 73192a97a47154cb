"""Byte streams to a transmitter, with a deadline on reading, and what its registers reply there."""

import select
import socket
import time
from abc import ABC, abstractmethod
from dataclasses import dataclass

import serial

from endoscope_devices.device import DeviceError
from endoscope_devices.load_cells.calibration_file import SerialSettings
from endoscope_devices.load_cells.modbus_framing import Framing, ReplyError, ReplyTrouble

# A Modbus frame has at most 260 bytes (Modbus Messaging on TCP/IP V1.0b, section 3.1.3).
LONGEST = 260
MODBUS_TCP_PORT = 502
_CONNECTS_S = 1.0
# Start, eight of data, parity or a second stop bit, stop.
_BITS = 11
# After each fence that failed, the next waits for a longer silence: the fewer are under way at a
# time, the later an answer may come and still be matched to its request.
_LONGER = 8
_LONGEST_SILENCE_NS = 1_000_000_000


class LineLostError(DeviceError):
    """The line went away: unplugged, or closed by the other side."""


class Line[Opened: serial.Serial | socket.socket](ABC):
    """A byte stream, used by one thread; LineLostError where it goes away."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._handle: Opened | None = None

    @abstractmethod
    def open(self) -> None:
        """Connect; LineLostError with advice where it cannot be opened."""

    def write(self, data: bytes) -> None:
        """Send bytes."""
        try:
            self._send(data)
        except OSError as error:
            raise LineLostError(f'{self._name} is gone: {error}') from error

    def read(self, wanted: int, deadline_ns: int) -> bytes:
        """Bytes that arrive until there are `wanted`, or to a deadline of ``time.monotonic_ns``."""
        data = b''
        try:
            while len(data) < wanted:
                left = max(0.0, (deadline_ns - time.monotonic_ns()) * 1e-9)
                part = self._receive(wanted - len(data), left)
                if not part:
                    break
                data += part
        except OSError as error:
            raise LineLostError(f'{self._name} is gone: {error}') from error
        return data

    def close(self) -> None:
        """Close the line."""
        if self._handle is not None:
            self._handle.close()
            self._handle = None

    @property
    def _opened(self) -> Opened:
        if self._handle is None:
            raise LineLostError(f'{self._name} is not connected')
        return self._handle

    @abstractmethod
    def _send(self, data: bytes) -> None:
        """Send bytes, or raise OSError or LineLostError."""

    @abstractmethod
    def _receive(self, most: int, timeout: float) -> bytes:
        """Bytes that arrive within `timeout` s, none if none do; errors as in `_send`."""


class SerialLine(Line[serial.Serial]):
    """A serial port, silent 3.5 characters between frames (Modbus over Serial Line, 2.5.1.1)."""

    def __init__(self, port: str, settings: SerialSettings) -> None:
        super().__init__(f'serial port {port}')
        self._path = port
        self._settings = settings
        self._silence_s = 3.5 * _BITS / settings.baud if settings.baud <= 19200 else 0.00175
        self._heard_s = 0.0

    def open(self) -> None:
        """See :class:`Line`."""
        try:
            self._handle = serial.Serial(
                self._path,
                self._settings.baud,
                parity=self._settings.parity[0].upper(),
                stopbits=self._settings.stop_bits,
                timeout=0.0,
                write_timeout=1.0,
                exclusive=True,
            )
        except (OSError, ValueError) as error:
            raise LineLostError(
                f'{self._name} cannot be opened ({error}): is it plugged in and yours?'
            ) from error

    def _send(self, data: bytes) -> None:
        time.sleep(max(0.0, self._heard_s + self._silence_s - time.monotonic()))
        self._opened.write(data)

    def _receive(self, most: int, timeout: float) -> bytes:
        port = self._opened
        port.timeout = timeout
        data: bytes = port.read(most)
        if data:
            self._heard_s = time.monotonic()
        return data


class TcpLine(Line[socket.socket]):
    """A TCP connection to ``HOST`` or ``HOST:PORT`` (502); DeviceError for another address."""

    def __init__(self, address: str) -> None:
        host, _, port = address.partition(':')
        if not host or (port and not port.isdecimal()) or int(port or 1) not in range(1, 65536):
            raise DeviceError(f"'{address}' is not an address: give HOST or HOST:PORT")
        self._address = (host, int(port) if port else MODBUS_TCP_PORT)
        super().__init__(f'{self._address[0]}:{self._address[1]}')

    def open(self) -> None:
        """See :class:`Line`."""
        try:
            self._handle = socket.create_connection(self._address, _CONNECTS_S)
            self._handle.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        except OSError as error:
            raise LineLostError(
                f'{self._name} does not accept a connection ({error}): is the transmitter on?'
            ) from error

    def _send(self, data: bytes) -> None:
        self._opened.sendall(data)

    def _receive(self, most: int, timeout: float) -> bytes:
        connection = self._opened
        if not select.select([connection], [], [], timeout)[0]:
            return b''
        data = connection.recv(most)
        if not data:
            raise LineLostError(f'{self._name} closed the connection')
        return data


@dataclass(frozen=True)
class RegisterReading:
    """16-bit registers with the time at which they were asked for."""

    asked_ns: int  # of ``time.monotonic_ns``
    registers: tuple[int, ...]


class RegisterReader:
    """One request at a time on one line, which the caller has opened.

    Modbus RTU replies do not identify their request: a late one looks like the reply to the next.
    So after a time-out, and after unsolicited bytes, a fence is set: another number of registers is
    requested, and until its reply has come, which a transmitter sends in order, all replies are
    ignored. Consecutive fences request different numbers: a late reply to one of them must not open
    the next.
    """

    def __init__(self, line: Line, framing: Framing, reply_timeout: float) -> None:
        self._line = line
        self._framing = framing
        self._timeout_ns = round(reply_timeout * 1e9)
        self._fenced = False
        self._fences = 0  # put up so far
        self._silence_ns = self._timeout_ns // 4  # which the next fence waits for
        self.unexpected = 0  # bytes that came without a question

    def read(self, address: int, count: int) -> RegisterReading:
        """Read registers; ReplyError where no acceptable reply comes in time."""
        waiting = len(self._line.read(LONGEST, 0))
        self.unexpected += waiting
        if waiting or self._fenced:
            self._fence(address, count)
        try:
            return self._ask(address, count)
        except ReplyError:
            self._fenced = True
            raise

    def _fence(self, address: int, count: int) -> None:
        self._fenced = True
        # A line that is never silent is asked all the same, and answers with nothing acceptable.
        latest = time.monotonic_ns() + _LONGEST_SILENCE_NS
        while (now := time.monotonic_ns()) < latest:
            if not self._line.read(LONGEST, now + self._silence_ns):
                break
        self._silence_ns = min(_LONGER * self._silence_ns, _LONGEST_SILENCE_NS)
        others = range(1, count) if count > 1 else range(2, 5)
        self._fences += 1
        try:
            self._ask(address, others[self._fences % len(others)])
        except ReplyError as error:
            # A refusal answers the fence's own question as well: two registers may not exist.
            if error.trouble is not ReplyTrouble.REFUSED:
                raise
        self._fenced = False
        self._silence_ns = self._timeout_ns // 4

    def _ask(self, address: int, count: int) -> RegisterReading:
        asked = time.monotonic_ns()
        deadline = asked + self._timeout_ns
        self._line.write(self._framing.request(address, count))
        while True:
            registers = self._framing.accept(self._reply(deadline))
            if registers is not None:
                return RegisterReading(asked, registers)

    def _reply(self, deadline_ns: int) -> bytes:
        data = b''
        while len(data) < min(self._framing.length(data), LONGEST):
            part = self._line.read(self._framing.length(data) - len(data), deadline_ns)
            if not part:
                raise ReplyError(
                    ReplyTrouble.SILENCE,
                    f'{len(data)} bytes within {self._timeout_ns * 1e-6:.0f} ms',
                )
            data += part
        return data

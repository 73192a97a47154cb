"""An Aurora at a serial port: a command goes out, a whole reply or none comes back.

A reply counts once its CRC and its characters have been checked (Aurora API Guide, communication).
"""

import re
import termios
import time

import serial

from endoscope_devices.device import DeviceError

_FIRST_BAUD = 9600
_FRAME_BAUD = 115200
_COMM_FIRST, _COMM_FRAME = 'COMM:00000', 'COMM:50000'  # these rates, with 8N1 and no handshake
_CHUNK = 4096
_LONGEST = 2000
_FRAME_S = 0.1
_COMMAND_S = 1.0
_RESET_S = 5.0
_SETTLED_S = 0.03
_WHOLE = re.compile(rb'[\x20-\x7e\n]*[0-9A-F]{4}\r')
_REFUSAL = re.compile(r'ERROR([0-9A-F]{2})')
# Of the guide's table of error codes, those with which a command of ours may be answered.
_WORDS = {
    '01': 'Invalid command',
    '04': 'Invalid CRC calculated for command',
    '05': 'Time-out on command execution',
    '06': 'Unable to set up new communication parameters',
    '08': 'Invalid port handle selected',
    '0C': 'Command is invalid while in the current mode',
    '0D': 'No tool assigned to the selected port handle',
    '0E': 'Selected port handle not initialized',
    '10': 'System not initialized',
    '12': 'Unable to start tracking',
    '13': 'Unable to initialize Tool-in-Port',
    '15': 'Unable to initialize the Measurement System',
}
_Gone = (serial.SerialException, OSError, termios.error)


def crc16(data: bytes) -> int:
    """CRC-16/ARC, reflected, from 0 (Aurora API Guide, appendix); ``INIT:`` gives E3A5."""
    crc = 0
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ 0xA001 if crc & 1 else crc >> 1
    return crc


class TrackerReplyError(DeviceError):
    """A reply that is missing, corrupt, or a refusal by the tracker."""

    def __init__(self, command: str, words: str, *, silent: bool = False) -> None:
        super().__init__(f'tracker, {command} {words}')
        self.silent = silent  # whether nothing came at all


class AuroraPort:
    """Commands and replies at a device path."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._line: serial.Serial | None = None

    def open(self) -> None:
        """Open the port and bring the tracker to 115200 baud and set-up mode, or raise DeviceError.

        A tracker that does not answer at 9600 baud was left at another rate: a serial break resets
        it.
        """
        try:
            self._line = line = serial.Serial(
                self._path, _FIRST_BAUD, timeout=0.0, write_timeout=1.0, exclusive=True
            )
        except (serial.SerialException, OSError) as error:
            raise DeviceError(
                f'serial port {self._path} cannot be opened ({error}): is the tracker plugged in?'
            ) from error
        try:
            self.ask('INIT:')
        except TrackerReplyError:
            self._reset(line)
            self.ask('INIT:')
        self.ask(_COMM_FRAME)
        line.baudrate = _FRAME_BAUD

    def ask(self, command: str) -> str:
        """Reply, without CRC, to a command with its colon but no CRC; or TrackerReplyError."""
        if self._line is None:
            raise TrackerReplyError(command, 'not connected', silent=True)
        wait = _FRAME_S if command.startswith('TX') else _COMMAND_S
        asked = command.encode()
        try:
            self._line.read(_CHUNK)
            self._line.write(asked + f'{crc16(asked):04X}\r'.encode())
            reply = _read_line(self._line, time.monotonic() + wait)
        except _Gone as error:
            words = f'serial port {self._path} is gone: {error}'
            raise TrackerReplyError(command, words, silent=True) from error
        if not reply.endswith(b'\r'):
            words = f'{len(reply)} bytes within {1e3 * wait:.0f} ms instead of a reply'
            raise TrackerReplyError(command, words, silent=not reply)
        if not _WHOLE.fullmatch(reply) or crc16(reply[:-5]) != int(reply[-5:-1], 16):
            raise TrackerReplyError(command, 'a reply with a wrong CRC')
        text = reply[:-5].decode()
        if refusal := _REFUSAL.fullmatch(text):
            raise TrackerReplyError(command, _WORDS.get(refusal[1], text))
        return text

    def fence(self) -> None:
        """Make sure that no earlier reply is still to come; DeviceError where it has not come yet.

        The tracker answers in order: once the line has been quiet and the tracker has then sent
        its revision, nothing older is under way.
        """
        if self._line is not None:
            try:
                self._line.timeout = _SETTLED_S
                while self._line.read(_CHUNK):
                    pass
                self._line.timeout = 0.0
            except _Gone as error:
                raise self._gone(error) from error
        reply = self.ask('APIREV:')
        if len(reply) != len('G.000.000'):
            raise TrackerReplyError('APIREV:', 'another reply')

    def close(self) -> None:
        """Return the tracker to 9600 baud, and release the port."""
        if self._line is None:
            return
        try:
            self.ask(_COMM_FIRST)
        except TrackerReplyError:
            # It is gone; a break will bring it back the next time.
            pass
        finally:
            self._line.close()
            self._line = None

    def _reset(self, line: serial.Serial) -> None:
        """Send a serial break; the tracker says it is at 9600 baud (Aurora API Guide, RESET)."""
        try:
            line.baudrate = _FIRST_BAUD
            termios.tcflush(line.fileno(), termios.TCIOFLUSH)
            line.send_break()
            reply = _read_line(line, time.monotonic() + _RESET_S)
        except _Gone as error:
            raise self._gone(error) from error
        if b'RESETBE6F' not in reply:
            raise DeviceError(
                f'no Aurora answers at {self._path}: is it switched on, and the port the right one?'
            )

    def _gone(self, error: Exception) -> DeviceError:
        return DeviceError(f'serial port {self._path} is gone: {error}')


def _read_line(line: serial.Serial, deadline: float) -> bytes:
    data = b''
    while not data.endswith(b'\r') and len(data) < _LONGEST:
        line.timeout = max(0.0, deadline - time.monotonic())
        part = line.read(max(1, line.in_waiting))
        if not part:
            break
        data += part
    line.timeout = 0.0
    return data

"""Stands between ndicapi and the tracker's line, and lets only whole replies through.

ndicapi 3.7.6 ends the process (segmentation fault) when a reply holds a byte from 80h on, as one
flipped bit makes it, and it fixes the wait for a reply at five seconds.  So it talks to a
pseudo-terminal of ours.  Each command goes on to the tracker; its reply comes back once its CRC and
its characters have been checked, and otherwise a well-formed error reply in its place.
"""

import os
import re
import select
import termios
import threading
import time
import tty

import serial

from endoscope_devices.em_tracker.ndi_crc import crc16
from endoscope_devices.motor_device import DeviceError

_CHUNK = 4096
_LONGEST = 2000
_RESET_S = 5.0
_SETTLED_S = 0.03
_COMMAND_S = 1.0
_WHOLE = re.compile(rb'[\x20-\x7e\n]*[0-9A-F]{4}\r')
_NOTHING = b'ERROR01'


class NdiLineGuard:
    """A serial port, and a pseudo-terminal at which ndicapi finds it.

    The port is touched by one thread at a time: by the guard's between a command and its reply, by
    the caller's otherwise.
    """

    def __init__(self, path: str, frame_timeout: float = 0.1) -> None:
        self._path = path
        self._frame_timeout = frame_timeout  # longest wait in s for the reply to TX
        self.trouble = ''  # what was wrong with the last reply; empty if nothing
        self.silent = False  # whether the last reply did not come at all
        try:
            self._port = serial.Serial(path, 9600, timeout=0.0, write_timeout=1.0, exclusive=True)
        except (serial.SerialException, OSError) as error:
            raise DeviceError(
                f'serial port {path} cannot be opened ({error}): is the tracker plugged in?'
            ) from error
        self._ends = os.openpty()
        tty.setraw(self._ends[1])
        self.inner = os.ttyname(self._ends[1])  # path for ndicapi
        self._wake = os.pipe()
        self._thread = threading.Thread(target=self._run, name='tracker line', daemon=True)
        self._thread.start()

    def set_baud(self, baud: int) -> None:
        """Go on at another rate in bit/s, which the tracker has agreed to."""
        self._port.baudrate = baud

    def settle(self) -> None:
        """Drop what still comes, until nothing has come for a while."""
        try:
            self._port.timeout = _SETTLED_S
            while self._port.read(_CHUNK):
                pass
            self._port.timeout = 0.0
        except (serial.SerialException, OSError, termios.error) as error:
            raise DeviceError(f'serial port {self._path} is gone: {error}') from error

    def reset(self) -> None:
        """Send a serial break; the tracker says it is at 9600 baud (Aurora API Guide, RESET)."""
        try:
            self._port.baudrate = 9600
            termios.tcflush(self._port.fileno(), termios.TCIOFLUSH)
            self._port.send_break()
            reply = self._read_line(time.monotonic() + _RESET_S)
        except (serial.SerialException, OSError, termios.error) as error:
            raise DeviceError(f'serial port {self._path} is gone: {error}') from error
        if b'RESETBE6F' not in reply:
            raise DeviceError(
                f'no Aurora answers at {self._path}: is it switched on, and the port the right one?'
            )

    def close(self) -> None:
        """Let go of the port."""
        os.write(self._wake[1], b'x')
        self._thread.join()
        self._port.close()
        for end in (*self._ends, *self._wake):
            os.close(end)

    def _run(self) -> None:
        command = b''
        while True:
            ready, _, _ = select.select([self._ends[0], self._wake[0]], [], [])
            if self._wake[0] in ready:
                return
            command += os.read(self._ends[0], _CHUNK)
            while b'\r' in command:
                line, _, command = command.partition(b'\r')
                os.write(self._ends[0], self._exchange(line + b'\r'))

    def _exchange(self, command: bytes) -> bytes:
        wait = self._frame_timeout if command.startswith(b'TX') else _COMMAND_S
        try:
            self._port.read(_CHUNK)
            self._port.write(command)
            reply = self._read_line(time.monotonic() + wait)
        except (serial.SerialException, OSError, termios.error) as error:
            return self._refused(f'serial port {self._path} is gone: {error}', silent=True)
        if not reply.endswith(b'\r'):
            return self._refused(
                f'{len(reply)} bytes within {1e3 * wait:.0f} ms instead of a reply',
                silent=not reply,
            )
        if not _WHOLE.fullmatch(reply) or crc16(reply[:-5]) != int(reply[-5:-1], 16):
            return self._refused('a reply with a wrong CRC', silent=False)
        self.trouble = ''
        return reply

    def _refused(self, words: str, *, silent: bool) -> bytes:
        self.trouble = words
        self.silent = silent
        return _NOTHING + f'{crc16(_NOTHING):04X}\r'.encode()

    def _read_line(self, deadline: float) -> bytes:
        data = b''
        while not data.endswith(b'\r') and len(data) < _LONGEST:
            self._port.timeout = max(0.0, deadline - time.monotonic())
            part = self._port.read(max(1, self._port.in_waiting))
            if not part:
                break
            data += part
        self._port.timeout = 0.0
        return data

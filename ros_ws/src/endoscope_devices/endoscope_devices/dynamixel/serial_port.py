"""The SDK's port handler, extended by 4.5 Mbaud, exclusive access, and blocking waits."""

import select
import termios
import time
from pathlib import Path

import serial
from dynamixel_sdk import PortHandler

from endoscope_devices.device import DeviceError
from endoscope_devices.dynamixel.control_table import BAUD_CODES

BITS_PER_BYTE = 10
_TTY = Path('/sys/class/tty')


def byte_time(baud: int) -> float:
    """Seconds that a byte (8 data bits, no parity, 1 stop bit) takes at `baud` bit/s."""
    return BITS_PER_BYTE / baud


def latency_timer(port_name: str) -> float | None:
    """Latency timer in s of a USB adapter of FTDI; None if it has none."""
    file = _TTY / Path(port_name).resolve().name / 'device' / 'latency_timer'
    return float(file.read_text()) * 1e-3 if file.is_file() else None


class BusPort(PortHandler):
    """A serial port with a Dynamixel bus behind it."""

    def __init__(self, port_name: str, baud: int) -> None:
        super().__init__(port_name)
        self.baudrate = baud

    def getCFlagBaud(self, baudrate: int) -> int:
        """Accept the speeds of the servos; the SDK's list ends at 4 Mbaud."""
        return baudrate if baudrate in BAUD_CODES.values() else -1

    def setupPort(self, cflag_baud: int) -> bool:
        """Open the port and lock it: a second master would garble the bus."""
        super().setupPort(cflag_baud)
        self.ser.exclusive = True
        return True

    def clearPort(self) -> None:
        """Discard received bytes; raises OSError when the adapter is gone."""
        try:
            super().clearPort()
        except termios.error as error:
            raise OSError(*error.args) from error

    def open(self) -> None:
        """Open the port; DeviceError if it cannot be used, or the speed is none of the servos'."""
        try:
            opened = self.openPort()
        except serial.SerialException as error:
            self.close()
            raise DeviceError(_why(self.port_name, error)) from error
        if not opened:
            known = ', '.join(str(baud) for baud in BAUD_CODES.values())
            raise DeviceError(f'{self.port_name}: servos do not know {self.baudrate} baud: {known}')

    def close(self) -> None:
        """Close the port, open or not."""
        if self.ser is not None:
            self.closePort()

    def send(self, data: bytes) -> None:
        """Write all bytes; raises OSError when the adapter is gone."""
        self.writePort(data)

    def receive(self, deadline: float) -> bytes:
        """Bytes that are there, waiting for the first up to `deadline`, s of ``time.monotonic``.

        What came before it and could not be fetched in time is still given. OSError without an
        adapter.
        """
        wait = max(0.0, deadline - time.monotonic())
        ready, _, _ = select.select([self.ser.fileno()], [], [], wait)
        return bytes(self.ser.read(4096)) if ready else b''


def _why(port: str, error: serial.SerialException) -> str:
    if not Path(port).exists():
        return f'{port}: there is no such port; plug the adapter in or give another port'
    if 'exclusively lock' in str(error):
        return f'{port}: another program uses this port; end it first'
    return f'{port}: {error}'

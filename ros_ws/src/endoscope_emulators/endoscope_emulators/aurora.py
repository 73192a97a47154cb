"""An Aurora behind a pseudo-terminal, for drivers and third-party clients alike.

``python -m endoscope_emulators.aurora --link /tmp/aurora`` runs one by itself.

The line has the host's baud rate: what comes at another rate than the tracker's is garbled, and
bytes take the time that they take at that rate.  A pseudo-terminal carries no serial break.  In its
place stands what ndicapi and our driver do right before each break: both queues are emptied, here
after garbled bytes had come.
"""

import argparse
import fcntl
import os
import select
import signal
import struct
import sys
import termios
import threading
import time
import tty
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from endoscope_core.exit_status import ClosedOnExit
from endoscope_core.kinematics import tip_pose
from endoscope_emulators.aurora_unit import AuroraUnit, SensorSource, SensorView

_TERMIOS_BAUD = {
    getattr(termios, f'B{rate}'): rate for rate in (9600, 19200, 38400, 57600, 115200, 921600)
}
_PACKET_MODE = struct.pack('i', 1)
_EMPTIED = termios.TIOCPKT_FLUSHREAD | termios.TIOCPKT_FLUSHWRITE
_BITS_A_BYTE = 10
_CHUNK = 4096
_STEP_S = 0.004


class AuroraEmulator(ClosedOnExit):
    """Serves commands in a thread until closed; a frame is ready `latency` s after its time."""

    def __init__(
        self,
        sources: Sequence[SensorSource],
        link: Path,
        *,
        latency: float = 0.0,
        line_speed: bool = True,
    ) -> None:
        self.unit = AuroraUnit(sources, time.monotonic, latency)  # the tracker behind the line
        self.link = link  # to the port; it stays the same when the tracker is plugged in again
        # What happens to replies on the way: pieces, each with its delay in s.
        self.tap: Callable[[bytes], Sequence[tuple[float, bytes]]] = lambda data: [(0.0, data)]
        self._line_speed = line_speed  # whether bytes take their time
        self._ends: tuple[int, int] | None = None
        self._wake: tuple[int, int] = (-1, -1)
        self._thread: threading.Thread | None = None
        self._received = b''
        self._garbled = False
        self.plug_in()

    def plug_in(self) -> None:
        """Connect the tracker, which has just been switched on."""
        self._ends = os.openpty()
        tty.setraw(self._ends[1])
        fcntl.ioctl(self._ends[0], termios.TIOCPKT, _PACKET_MODE)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(self._ends[1]))
        self.unit.reset()
        self._received = b''
        self._garbled = False
        self._wake = os.pipe()
        self._thread = threading.Thread(target=self._run, name='aurora', daemon=True)
        self._thread.start()

    def unplug(self) -> None:
        """Take the port away, as pulling out the cable does."""
        if self._thread is None or self._ends is None:
            return
        os.write(self._wake[1], b'x')
        self._thread.join()
        self._thread = None
        self.link.unlink(missing_ok=True)
        for end in (*self._ends, *self._wake):
            os.close(end)
        self._ends = None

    def serial_break(self) -> None:
        """Let the tracker see the break that a pseudo-terminal does not carry."""
        reply = self.unit.reset()
        self._send(reply, self.unit.baud)

    def close(self) -> None:
        """Stop and take the port away."""
        self.unplug()

    @property
    def _master(self) -> int:
        if self._ends is None:
            raise RuntimeError('the tracker is unplugged')
        return self._ends[0]

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._master, self._wake[0]], [], [])
            if self._wake[0] in ready:
                return
            data = os.read(self._master, _CHUNK)
            if data[0] & _EMPTIED == _EMPTIED and self._garbled:
                self._garbled = False
                self.serial_break()
            elif data[0] == termios.TIOCPKT_DATA:
                self._take(data[1:])

    def _take(self, data: bytes) -> None:
        if _TERMIOS_BAUD.get(termios.tcgetattr(self._master)[5]) != self.unit.baud:
            self._garbled = True
            self._received = b''
            return
        self._garbled = False
        *lines, self._received = (self._received + data).split(b'\r')
        for line in lines:
            if self._line_speed:
                time.sleep(_BITS_A_BYTE * (len(line) + 1) / self.unit.baud)
            # A new baud rate is in force once the reply to COMM has gone out at the old one.
            baud = self.unit.baud
            self._send(self.unit.answer(line), baud)

    def _send(self, reply: bytes, baud: int) -> None:
        step = max(1, int(_STEP_S * baud / _BITS_A_BYTE)) if self._line_speed else len(reply) + 1
        for delay, piece in self.tap(reply):
            time.sleep(delay)
            for start in range(0, len(piece), step):
                part = piece[start : start + step]
                if self._line_speed:
                    time.sleep(_BITS_A_BYTE * len(part) / baud)
                os.write(self._master, part)


class InstrumentInField:
    """The sensor in the tip of an instrument that bends with constant curvature.

    `bending` gives ``bend_x`` and ``bend_y`` in rad at a time in s. The base is placed in the frame
    of the field generator: m, (3,), and x, y, z, w. The sensor is mounted with a `roll` in rad
    about its own axis; `length` is that of the bending section in m.
    """

    def __init__(
        self,
        bending: Callable[[float], Sequence[float]],
        *,
        base_position: Sequence[float] = (0.05, -0.03, -0.2),
        base_orientation: Sequence[float] = (0.5, -0.5, 0.5, 0.5),
        roll: float = 0.0,
        length: float = 0.02,
    ) -> None:
        self.bending = bending
        self._place = np.array(base_position)
        self._turn = Rotation.from_quat(base_orientation)
        self._roll = Rotation.from_rotvec((0.0, 0.0, roll))
        self._length = length

    def __call__(self, seconds: float) -> SensorView:
        """Where the sensor is, some seconds since frame 0."""
        position, orientation = tip_pose(self.bending(seconds), self._length)
        turned = self._turn * Rotation.from_quat(orientation) * self._roll
        return SensorView(
            tuple((self._place + self._turn.apply(position)).tolist()),
            tuple(turned.as_quat().tolist()),
        )


def main(arguments: Sequence[str] | None = None) -> int:
    """Run an emulator in its own process until a signal ends it."""
    parser = argparse.ArgumentParser(
        prog='aurora_emulator', description='An NDI Aurora with one sensor at a pseudo-terminal.'
    )
    parser.add_argument('--link', type=Path, required=True, help='link to make to the port')
    parser.add_argument(
        '--bending',
        type=float,
        nargs=2,
        default=(0.0, 0.0),
        metavar=('X', 'Y'),
        help='bending of the instrument in rad',
    )
    given = parser.parse_args(arguments)
    bending = tuple(given.bending)
    endings = {signal.SIGINT, signal.SIGTERM}
    # The emulator's thread inherits the mask, so that the signal waits for this one.
    signal.pthread_sigmask(signal.SIG_BLOCK, endings)
    with AuroraEmulator([InstrumentInField(lambda _: bending)], given.link):
        print(given.link, flush=True)
        signal.sigwait(endings)
    return 0


if __name__ == '__main__':
    sys.exit(main())

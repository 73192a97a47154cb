"""An Aurora at a serial port, spoken to by ndicapi behind a guard.

ndicapi frees the interpreter while it waits for a reply to a command; its ``ndiProbe`` keeps it for
up to seven seconds and is not used.
"""

import ndicapy

from endoscope_devices.em_tracker.line_guard import NdiLineGuard
from endoscope_devices.motor_device import DeviceError

_FRAME_BAUD = 115200
_COMM = f'COMM:{{}}{ndicapy.NDI_8N1:03d}{ndicapy.NDI_NOHANDSHAKE}'


class TrackerReplyError(DeviceError):
    """A reply that is missing, spoilt, or says that the tracker refused."""

    def __init__(self, command: str, words: str, *, silent: bool = False) -> None:
        super().__init__(f'tracker, {command} {words}')
        self.silent = silent  # whether nothing came at all


class AuroraPort:
    """Commands and replies at a device path."""

    def __init__(self, path: str) -> None:
        self._path = path
        self._guard: NdiLineGuard | None = None
        self._device: object | None = None

    def open(self) -> None:
        """Open the port and bring the tracker to 115200 baud and set-up mode, or raise DeviceError.

        A tracker that does not answer at 9600 baud was left at another rate: a serial break resets
        it.
        """
        self._guard = NdiLineGuard(self._path)
        self._device = ndicapy.ndiOpen(self._guard.inner)
        if not self._device:
            raise DeviceError(f'ndicapi cannot open its end of the line to {self._path}')
        try:
            self.ask('INIT:')
        except TrackerReplyError:
            self._guard.reset()
            self.ask('INIT:')
        self.ask(_COMM.format(ndicapy.NDI_115200))
        self._guard.set_baud(_FRAME_BAUD)

    def ask(self, command: str) -> str:
        """Reply, without CRC, to a command with its colon but no CRC; or TrackerReplyError."""
        if self._guard is None:
            raise TrackerReplyError(command, 'not connected', silent=True)
        try:
            return str(ndicapy.ndiCommand(self._device, command))
        except OSError as error:
            words = self._guard.trouble
            raise TrackerReplyError(
                command, words or str(error), silent=bool(words) and self._guard.silent
            ) from error

    def fence(self) -> None:
        """Make sure that no earlier reply is still to come; DeviceError where it has not come yet.

        The tracker answers in order: once the line has been quiet and the tracker then told its
        revision, nothing older is under way.
        """
        if self._guard is not None:
            self._guard.settle()
        reply = self.ask('APIREV:')
        if len(reply) != len('G.000.000'):
            raise TrackerReplyError('APIREV:', 'another reply')

    def close(self) -> None:
        """Let the tracker be found at 9600 baud, and let go of the port."""
        if self._guard is None:
            return
        try:
            if self._device:
                self.ask(_COMM.format(ndicapy.NDI_9600))
        except TrackerReplyError:
            # It is gone; a break will bring it back the next time.
            pass
        finally:
            if self._device:
                ndicapy.ndiClose(self._device)
            self._device = None
            self._guard.close()
            self._guard = None

"""A serial cable: two pseudo-terminals and what lies between them."""

import os
import tty
from pathlib import Path

from endoscope_core.exit_status import ClosedOnExit
from endoscope_emulators.cables.byte_relay import ByteRelay, Tap, faithful


class SerialCable(ClosedOnExit):
    """Two serial ports that are connected; a driver opens one, an emulated device the other.

    A pseudo-terminal has no baud rate, parity or break: bytes arrive at once and whole.
    """

    def __init__(self, host: Path) -> None:
        # The driver's link to its port; it stays when the cable is plugged in again, as udev's do.
        self.host = host
        self.to_host: Tap = faithful  # what happens to bytes on the way; a test sets it
        self.to_device: Tap = faithful
        self._far_ends = os.openpty()
        tty.setraw(self._far_ends[1])
        self.device = os.ttyname(self._far_ends[1])  # path of the device's port
        self._near_ends: tuple[int, int] | None = None
        self._relay: ByteRelay | None = None
        self.plug_in()

    def plug_in(self) -> None:
        """Connect the host's end."""
        near = os.openpty()
        # The relay's end keeps a port of its own open, or reading would fail while no driver has.
        tty.setraw(near[1])
        self.host.unlink(missing_ok=True)
        self.host.symlink_to(os.ttyname(near[1]))
        self._near_ends = near
        self._relay = ByteRelay(near[0], self._far_ends[0], self._tap)

    def _tap(self, end: str) -> Tap:
        return self.to_device if end == 'near' else self.to_host

    def unplug(self) -> None:
        """Take the host's end away, as pulling out a USB adapter does."""
        if self._relay is None or self._near_ends is None:
            return
        self._relay.close()
        self._relay = None
        self.host.unlink(missing_ok=True)
        for end in self._near_ends:
            os.close(end)
        self._near_ends = None

    def close(self) -> None:
        """Take both ends away."""
        self.unplug()
        for end in self._far_ends:
            os.close(end)

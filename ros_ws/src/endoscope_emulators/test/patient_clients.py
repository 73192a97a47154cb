"""Clients of an emulated line, whose emulator a busy machine may keep from answering in time."""

import time

from dynamixel_sdk import PortHandler

from endoscope_devices.dynamixel.bring_up import BusSettings
from endoscope_devices.dynamixel.dynamixel_motors import DynamixelMotors
from endoscope_devices.dynamixel.packet_handler import NoReplyError

PATIENCE_S = 120.0


def opened(settings: BusSettings, mounts) -> DynamixelMotors:
    """Motors that are set up, tried again for as long as a servo does not answer."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        motors = DynamixelMotors(settings, mounts)
        try:
            motors.open()
        except NoReplyError:
            if time.monotonic() > deadline:
                raise
        else:
            return motors


class PatientPort(PortHandler):
    """ROBOTIS's own port, which waits so much longer for an answer, in s."""

    patience = 10.0

    def setPacketTimeout(self, packet_length):
        super().setPacketTimeout(packet_length)
        self.packet_timeout += 1e3 * self.patience

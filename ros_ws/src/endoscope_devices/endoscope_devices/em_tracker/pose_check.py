"""Detects poses that the sensor cannot have reached since the last one."""

import math

from scipy.spatial.transform import Rotation

from endoscope_devices.em_tracker.tx_reply import ToolReading

TURN_RATE = 25.0
"""Fastest turn of the tip in rad/s.

The fastest servo that the motor driver knows runs at 8.06 rad/s (XM430-W210, 77 rpm without load),
a joint at twice that with the nominal gear of 0.5, and two joints together at sqrt(2) times that.
"""

SPEED = 1.5
"""Fastest motion of the tip in m/s.

A bending section of 20 mm that turns at `TURN_RATE` moves its tip by 0.5 m/s; a hand that moves the
whole instrument stays below 1 m/s.
"""

TURN_NOISE = 0.037
POSITION_NOISE = 0.008
"""What noise may add in rad and m: six times the deviation of a difference of two readings.

That of a reading is 0.25 deg in the nominal rig, and taken for 0.9 mm.
"""

CONFIRMATIONS = 3
"""So many poses in a row that agree with each other are where the sensor now is."""


class PoseCheck:
    """Judges each pose, at `rate` frames a second, by the last one that was believed."""

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._believed: ToolReading | None = None
        self._candidate: ToolReading | None = None
        self._agreeing = 0

    def believable(self, tool: ToolReading) -> bool:
        """Whether servos and hand can have moved a tip there since the last believed frame."""
        if self._believed is not None and not self._near(self._believed, tool):
            agrees = self._candidate is not None and self._near(self._candidate, tool)
            self._agreeing = self._agreeing + 1 if agrees else 1
            self._candidate = tool
            if self._agreeing < CONFIRMATIONS:
                return False
        self._believed = tool
        self._candidate = None
        return True

    def _near(self, before: ToolReading, now: ToolReading) -> bool:
        seconds = (now.frame - before.frame) / self._rate
        first, second = Rotation.from_quat([before.orientation, now.orientation])
        turned = float((first.inv() * second).magnitude())
        moved = math.dist(before.position, now.position)
        return (
            turned <= TURN_NOISE + TURN_RATE * seconds and moved <= POSITION_NOISE + SPEED * seconds
        )

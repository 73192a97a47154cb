"""An instrument in the tracker's field that a test bends, hides and breaks."""

import time
from collections import deque
from itertools import pairwise

from scipy.spatial.transform import Rotation

from endoscope_emulators.aurora import InstrumentInField
from endoscope_emulators.aurora_unit import SensorView


def angle_between(first, second) -> float:
    return (Rotation.from_quat(first).inv() * Rotation.from_quat(second)).magnitude()


class Instrument:
    """The source of the emulated tracker's sensor."""

    roll = 0.4

    def __init__(self) -> None:
        self.bending = (0.0, 0.0)
        self.hidden = False
        self.broken = False
        self._bent = InstrumentInField(self._bending_at, roll=self.roll)
        self._followed = deque(maxlen=400)
        self._frame_zero = lambda: 0.0
        self._clock_offset = time.time() - time.monotonic()

    def follow_for(self, unit):
        """Bend as the slave did when a frame was measured, not when the frame is asked for."""
        self._frame_zero = lambda: unit.frame_zero + self._clock_offset
        return self._follow

    def _follow(self, sample) -> None:
        self._followed.append((sample.stamp_ns * 1e-9, sample.position))

    def _bending_at(self, seconds):
        then = self._frame_zero() + seconds
        for (_, before), (late, after) in pairwise(tuple(self._followed)):
            if late >= then:
                return before
            self.bending = after
        return self.bending

    def __call__(self, seconds):
        if self.hidden:
            return None
        return SensorView(broken=True) if self.broken else self._bent(seconds)

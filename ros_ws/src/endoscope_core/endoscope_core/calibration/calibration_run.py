"""The steps of one calibration: back to zero, rest, sinusoid, verdict; how an order of it fares."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from endoscope_core.calibration.records import TensionRecord
from endoscope_core.signals import CalibrationMotion, both_joints, calibration_motion, move

CALIBRATE, HOME = 'calibrate', 'home'
# A minimum-jerk move peaks at 1.875 times its mean speed.
_PEAK_OF_MEAN = 1.875


class OrderState(StrEnum):
    """As the states of a ROS action's goal are called, and `WAITING` before the first order."""

    WAITING = 'waiting'
    EXECUTING = 'executing'
    SUCCEEDED = 'succeeded'
    ABORTED = 'aborted'
    REJECTED = 'rejected'


class OrderCode(StrEnum):
    """Why an order was rejected or aborted."""

    NONE = ''
    BUSY = 'busy'
    BEYOND_REACH = 'beyond_reach'
    NO_SESSION = 'no_session'
    SESSION_ENDED = 'session_ended'
    TENSION_CEILING = 'tension_ceiling'
    STREAM_SILENT = 'stream_silent'
    TENSION_GAP = 'tension_gap'
    UNKNOWN_TUBE = 'unknown_tube'
    NOT_JUDGED = 'not_judged'
    NOT_REACHED = 'not_reached'


@dataclass(frozen=True)
class OrderFeedback:
    """How an order fares; its progress is relative, from 0 to 1."""

    order: str = ''  # `CALIBRATE` or `HOME`; empty before the first
    id: int = 0  # unique: the time in ns at which it was given, or just after it
    state: OrderState = OrderState.WAITING
    phase: str = ''  # what is done for it now
    progress: float = 0.0
    code: OrderCode = OrderCode.NONE  # why it was rejected or aborted
    words: str = ''  # the same for a person


class CalibrationStep(StrEnum):
    """Where a calibration is."""

    RETURNING = 'returning to zero'
    RESTING = 'resting'
    MOVING = 'moving'
    DONE = 'done'


@dataclass(frozen=True)
class CalibrationCommand:
    """What to command in one tick: joint-equivalent angle in rad and velocity in rad/s, (J,)."""

    position: tuple[float, ...]
    velocity: tuple[float, ...]


class CalibrationRun:
    """Commands a calibration tick by tick and collects the tensions that belong to it.

    The motors return to zero first, so that every calibration starts from pretension (first paper,
    section 2.2), and rest there a moment; then all joints follow the calibration motion, by default
    the first paper's sinusoid. `start` are the joint-equivalent motor angles now (J,) in rad,
    `wires` how many tensions are collected, `return_speed` the largest speed in rad/s on the way to
    zero, `rest` the s at zero before the motion; with `homing` it ends there.
    """

    def __init__(
        self,
        start: Sequence[float],
        wires: int,
        tick_ns: int,
        return_speed: float,
        rest: float,
        homing: bool = False,
        motion: CalibrationMotion | None = None,
    ) -> None:
        motion = motion or calibration_motion()
        self._samples = motion.samples
        self._tick_ns = tick_ns
        self._wires = wires
        tick = tick_ns * 1e-9
        largest = max(abs(x) for x in start)
        length = max(0.2, _PEAK_OF_MEAN * largest / return_speed)
        time = np.arange(round(length / tick) + 1) * tick
        legs = [move(x, 0.0, float(time[-1]))(time) for x in start]
        back = np.hstack([np.stack([leg[k] for leg in legs], axis=1) for k in (0, 1)])
        still = np.zeros((round(rest / tick), 2 * len(start)))
        parts = [back, still]
        if not homing:
            time = np.arange(round(motion.signal.duration / tick) + 1) * tick
            parts.append(np.hstack(both_joints(motion.signal).sample(time)))
        self._rows = np.vstack(parts)
        self._joints = len(start)
        self._returned = len(back)
        self._moving_from = len(back) + len(still)
        self._next = 0
        self.record: TensionRecord | None = None

    @property
    def step(self) -> CalibrationStep:
        """Where the calibration is."""
        if self._next >= len(self._rows):
            return CalibrationStep.DONE
        if self._next < self._returned:
            return CalibrationStep.RETURNING
        if self._next < self._moving_from:
            return CalibrationStep.RESTING
        return CalibrationStep.MOVING

    @property
    def progress(self) -> float:
        """Share of the commands that have been given, from 0 to 1."""
        return self._next / len(self._rows)

    def command(self, stamp_ns: int, periods: int) -> CalibrationCommand | None:
        """Command for the tick at ``stamp_ns``, ``periods`` ms after the last; None when done.

        However far apart the ticks are, the last command is the motion's end.
        """
        last = len(self._rows) - 1
        if self._next > last:
            return None
        if self._next >= self._moving_from and self.record is None:
            into = (self._next - self._moving_from) * self._tick_ns
            self.record = TensionRecord(self._wires, stamp_ns - into, self._tick_ns, self._samples)
        row = self._rows[self._next].tolist()
        self._next = min(self._next + periods, last) if self._next < last else last + 1
        return CalibrationCommand(tuple(row[: self._joints]), tuple(row[self._joints :]))

    def add_tension(self, stamp_ns: int, tension: Sequence[float]) -> None:
        """Take a reading of all wires in N, shape (W,)."""
        if self.record is not None:
            self.record.add(stamp_ns, tension)

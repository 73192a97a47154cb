"""What was measured in the demonstration, ready to be shown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bringup.demo.procedure import CalibrationFacts, Method
from endoscope_core.metrics import tracking_rmse, width_at_mid_height

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CalibrationOutcome:
    """One calibration: what the wires said and what was made of it."""

    facts: CalibrationFacts  # what was announced
    time: Array  # (N,), s since the sinusoid began
    tension: Array  # (N, 4), N, in the order of `wires`
    wires: tuple[str, ...]
    tracked_at: Array  # (M,), stamps of the tracker on the same clock
    desired_deg: Array  # (M, J), commanded
    actual_deg: Array  # (M, J), tracked

    @property
    def backlash_deg(self) -> float:
        """Width of the loop at mid-height, the mean over the joints."""
        return _mean_width(self.desired_deg, self.actual_deg)


@dataclass(frozen=True)
class Crossing:
    """The longest stretch of a run in which a motor turned at more than half its top speed.

    No signal of the demonstration asks for that: it is the dead zone of a reversal.
    """

    seconds: float  # 0 where there was none
    width_deg: float  # bending for which the shaft would have turned as far without friction


@dataclass(frozen=True)
class TrackingRun:
    """One motion tracked by one method, over its steady part, at the tracker's stamps."""

    tube: str
    motion: str
    method: Method
    time: Array  # (N,), s since the motion began
    desired_deg: Array  # (N, J), asked for in this very run
    actual_deg: Array  # (N, J), as the tracker saw it
    reversals: tuple[Array, ...]  # of each joint, when what was asked for turned back
    crossing: Crossing

    @property
    def error_deg(self) -> Array:
        """Actual less desired angle, (N, J)."""
        return self.actual_deg - self.desired_deg

    @property
    def rmse_deg(self) -> float:
        """Root of the mean square error, the mean over the joints."""
        pairs = zip(self.desired_deg.T, self.actual_deg.T, strict=True)
        return float(np.mean([tracking_rmse(*pair) for pair in pairs]))

    @property
    def largest_deg(self) -> float:
        """Largest error of any joint."""
        return float(np.abs(self.error_deg).max())

    @property
    def backlash_deg(self) -> float:
        """Width of the loop at mid-height, the mean over the joints."""
        return _mean_width(self.desired_deg, self.actual_deg)


@dataclass(frozen=True)
class DemoResults:
    """All that the report shows."""

    calibrations: tuple[CalibrationOutcome, ...]
    runs: tuple[TrackingRun, ...]
    noise_deg: float  # what the tracker says of a tip that rests, rms
    messages: dict[str, int]  # recorded, by topic
    lost: dict[str, int]  # missing from the recording, by topic

    def run(self, tube: str, motion: str, method: Method) -> TrackingRun:
        """The run of that tube, motion and method; KeyError if it was not made."""
        for run in self.runs:
            if (run.tube, run.motion, run.method) == (tube, motion, method):
                return run
        raise KeyError((tube, motion, method))


def _mean_width(desired_deg: Array, actual_deg: Array) -> float:
    pairs = zip(desired_deg.T, actual_deg.T, strict=True)
    return float(np.mean([abs(width_at_mid_height(*pair)) for pair in pairs]))

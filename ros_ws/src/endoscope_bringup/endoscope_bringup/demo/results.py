"""What was measured in the demonstration, ready to be shown."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bringup.demo.procedure import Mode

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CalibrationOutcome:
    """One calibration: what the wires said and what was made of it.

    Attributes
    ----------
    tube : str
    time : array (N,)
        Seconds since the sinusoid began.
    tension : array (N, 4)
        Load cells in N, in the order of `wires`.
    wires : tuple of str
    loop_desired_deg, loop_actual_deg : array (M,)
        Commanded and tracked angle of `bend_x`.
    backlash_deg : float
        Width of that loop at mid-height.
    class_deg : float
        The class that the classifier chose.
    probabilities : dict of int to float
        By class in degrees.
    duration : float
        Seconds from request to result.
    """

    tube: str
    time: Array
    tension: Array
    wires: tuple[str, ...]
    loop_desired_deg: Array
    loop_actual_deg: Array
    backlash_deg: float
    class_deg: float
    probabilities: dict[int, float]
    duration: float


@dataclass(frozen=True)
class TrackingRun:
    """One tracked motion of `bend_x`, at the tracker's stamps.

    Attributes
    ----------
    tube, motion : str
    mode : Mode
    time : array (N,)
        Seconds since the motion began.
    desired_deg, actual_deg : array (N,)
    rmse_deg, backlash_deg : float
        Over the steady part of the motion, the mean over both joints.
    """

    tube: str
    motion: str
    mode: Mode
    time: Array
    desired_deg: Array
    actual_deg: Array
    rmse_deg: float
    backlash_deg: float


@dataclass(frozen=True)
class DemoResults:
    """All that the report shows.

    Attributes
    ----------
    calibrations : tuple of CalibrationOutcome
    runs : tuple of TrackingRun
    messages : dict of str to int
        Recorded messages by topic.
    lost : dict of str to int
        Messages missing from the recording by topic.
    """

    calibrations: tuple[CalibrationOutcome, ...]
    runs: tuple[TrackingRun, ...]
    messages: dict[str, int]
    lost: dict[str, int]

    def run(self, tube: str, motion: str, mode: Mode) -> TrackingRun:
        """The run of that tube, motion and mode.

        Raises
        ------
        KeyError
            If it was not made.
        """
        for run in self.runs:
            if (run.tube, run.motion, run.mode) == (tube, motion, mode):
                return run
        raise KeyError((tube, motion, mode))

"""Size of the backlash as the tracker saw it during a calibration."""

from collections.abc import Sequence

import numpy as np

from endoscope_core.metrics import width_at_mid_height
from endoscope_core.signals import calibration_sinusoid


class BendingRecord:
    """Collects measured bending angles and compares them with the calibration sinusoid.

    Parameters
    ----------
    joints
        Number of joints J.
    """

    def __init__(self, joints: int) -> None:
        self._joints = joints
        self._stamps: list[int] = []
        self._angles: list[Sequence[float]] = []

    def add(self, stamp_ns: int, angle: Sequence[float]) -> None:
        """Take a reading in rad, shape (J,)."""
        self._stamps.append(stamp_ns)
        self._angles.append(angle)

    def backlash_size(self, start_ns: int) -> float | None:
        """Mean backlash size of the joints in the last whole period of the sinusoid.

        Parameters
        ----------
        start_ns
            Stamp at which the sinusoid began.

        Returns
        -------
        float or None
            In rad; None where the readings do not cover the period or show no loop.
        """
        signal = calibration_sinusoid()
        begin, end = signal.steady
        time = (np.array(self._stamps, dtype=np.int64) - start_ns) * 1e-9
        inside = (time >= begin) & (time < end)
        covered = np.concatenate(([begin], time[inside], [end]))
        if np.max(np.diff(covered)) > 0.02 * (end - begin):
            return None
        desired = signal(time[inside])[0]
        angles = np.array(self._angles)[inside]
        try:
            sizes = [width_at_mid_height(desired, angles[:, j]) for j in range(self._joints)]
        except ValueError:
            return None
        return float(np.mean(sizes))

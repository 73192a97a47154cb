"""What a calibration records: tensions on the classifier's grid, bending angles, zeros of cells."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import EndoscopeError
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.names import WIRES
from endoscope_core.signals import calibration_sinusoid

Array = NDArray[np.float64]

LONGEST_GAP_NS = 40_000_000
"""Longest time between readings that a straight line may bridge.

A reply that is lost leaves up to this between the readings on either side, at a time-out of 20 ms
and with the fence that follows.  What it costs where the tension bends most, `endoscope bench
calibration_rate` measures.
"""

LONGEST_INTERVAL_NS = 12_500_000
"""Longest interval in which an instant may lie on average: 100 Hz, a quarter for lost readings."""
WORTH_TELLING = 0.3
"""In N: three standard deviations of the poorest zeros that the classifier was trained with."""
_WINDOW = 50


class TensionGapError(EndoscopeError, ValueError):
    """Too few tensions came for the record to be judged."""


class TensionRecord:
    """Tensions of W wires from `start_ns` on, resampled to N `samples`, `period_ns` apart.

    The readings come when the line carries them: their rate is known from their stamps alone, and
    any from 100 Hz on will do. Gaps of up to `longest_gap_ns` are bridged.
    """

    def __init__(
        self,
        wires: int,
        start_ns: int,
        period_ns: int,
        samples: int,
        longest_gap_ns: int = LONGEST_GAP_NS,
    ) -> None:
        self.start_ns = start_ns
        self._period_ns = period_ns
        self._samples = samples
        self._longest_gap_ns = longest_gap_ns
        # Room for a source that is somewhat faster than the grid, and for one reading either side.
        self._stamps = np.zeros(samples + samples // 2 + 2, dtype=np.int64)
        self._values = np.zeros((len(self._stamps), wires))
        self._count = 0

    def add(self, stamp_ns: int, tension: Sequence[float]) -> None:
        """Take a reading in N, shape (W,); one that is not newer than the last is left out."""
        if self._count and stamp_ns <= self._stamps[self._count - 1]:
            return
        if stamp_ns < self.start_ns - self._longest_gap_ns or self._count == len(self._stamps):
            return
        self._stamps[self._count] = stamp_ns
        self._values[self._count] = tension
        self._count += 1

    @property
    def complete(self) -> bool:
        """Whether a reading at or after the last instant has been taken."""
        return self._count > 0 and bool(self._stamps[self._count - 1] >= self._end_ns)

    @property
    def _end_ns(self) -> int:
        return self.start_ns + (self._samples - 1) * self._period_ns

    def resampled(self) -> Array:
        """Tensions (N, W) in N at the instants of the grid, by linear interpolation.

        TensionGapError if a gap is too long, or the readings are too far apart.
        """
        # Between two readings the tension is taken for a straight line, and the classifier is
        # trained with readings joined so: over 10 ms it misses the tension by less than one
        # reading's noise all but where a wire turns from pulling to paying out, and a filter that
        # takes noise away takes the turning of the loop with it.
        since = self._stamps[: self._count] - self.start_ns
        intervals = self._intervals()
        longest = int(np.argmax(intervals))
        if intervals[longest] > self._longest_gap_ns:
            raise TensionGapError(
                f'no tension for {intervals[longest] * 1e-6:.0f} ms from '
                f'{np.sum(intervals[:longest]) * 1e-9:.3f} s on; at most '
                f'{self._longest_gap_ns * 1e-6:.0f} ms can be bridged'
            )
        # Of that in which an instant lies on average.
        interval = float(np.sum(intervals.astype(float) ** 2) / np.sum(intervals))
        if interval > LONGEST_INTERVAL_NS:
            raise TensionGapError(
                f'tensions came {interval * 1e-6:.1f} ms apart; at most '
                f'{LONGEST_INTERVAL_NS * 1e-6:.1f} ms can be judged: read the load cells at '
                '100 Hz or more'
            )
        grid = np.arange(self._samples) * self._period_ns
        values = self._values[: self._count]
        return np.stack([np.interp(grid, since, column) for column in values.T], axis=1)

    def _intervals(self) -> NDArray[np.int64]:
        """Times in ns between readings, cut off where the record begins and ends."""
        stamps = self._stamps[: self._count]
        inside = stamps[(stamps > self.start_ns) & (stamps < self._end_ns)]
        return np.diff(np.concatenate(([self.start_ns], inside, [self._end_ns])))


class BendingRecord:
    """Collects measured bending angles (J,) and compares them with the calibration sinusoid."""

    def __init__(self, joints: int) -> None:
        self._joints = joints
        self._stamps: list[int] = []
        self._angles: list[Sequence[float]] = []

    def add(self, stamp_ns: int, angle: Sequence[float]) -> None:
        """Take a reading in rad, shape (J,)."""
        self._stamps.append(stamp_ns)
        self._angles.append(angle)

    def backlash_size(self, start_ns: int) -> float | None:
        """Mean backlash size (rad) of the joints in the last whole period of a sinusoid.

        It began at `start_ns`. None where the readings do not cover the period or show no loop.
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


def zero_errors(tension: Array) -> Array:
    """What cells read in N where their wires hang loose (W,), in a calibration (N, W) at 1 kHz."""
    # At the ends of a calibration motion one wire of a joint pulls and the other is paid out until
    # it is slack, for a fifth of the time in the median of simulated tubes. The least mean over
    # 50 ms is then the zero, which noise hardly moves.
    sums = np.cumsum(tension, axis=0)
    least: Array = ((sums[_WINDOW:] - sums[:-_WINDOW]) / _WINDOW).min(axis=0)
    return least


def words_of(errors: Array, wires: Sequence[str]) -> str:
    """Sentence that names the cells whose zero is off by much of `errors` (N); empty if none is."""
    off = [
        f'{wire} by {error:+.2f} N'
        for wire, error in zip(wires, errors.tolist(), strict=True)
        if abs(error) > WORTH_TELLING
    ]
    return f'zero of a load cell is off: {", ".join(off)}; set it again' if off else ''


def with_zeros(message: str, errors: Array | None) -> str:
    """A message, and what zeros of cells are off by where `errors`, in N, are large."""
    words = '' if errors is None else words_of(errors, WIRES)
    return f'{message}; {words}' if words else message

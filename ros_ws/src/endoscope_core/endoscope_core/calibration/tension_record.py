"""Collects wire tensions by their stamps and lays them on the grid that the classifier reads."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import EndoscopeError

Array = NDArray[np.float64]


class TensionGapError(EndoscopeError, ValueError):
    """Too many samples are missing for the record to be judged."""


class TensionRecord:
    """Tensions of W wires from a start time on, resampled to N equally spaced instants.

    Parameters
    ----------
    wires
        Number of wires W.
    start_ns, period_ns, samples
        The grid: stamp of the first instant and distance of the instants in ns, and their number N.
    longest_gap
        Largest distance in periods of two readings between which values may be interpolated.
    most_missing
        Largest share of instants without a reading of their own.
    """

    def __init__(
        self,
        wires: int,
        start_ns: int,
        period_ns: int,
        samples: int,
        longest_gap: int = 20,
        most_missing: float = 0.02,
    ) -> None:
        self.start_ns = start_ns
        self._period_ns = period_ns
        self._samples = samples
        self._longest_gap = longest_gap
        self._most_missing = most_missing
        # Room for a source that is somewhat faster than the grid, and for one reading either side.
        self._stamps = np.zeros(samples + samples // 2 + 2, dtype=np.int64)
        self._values = np.zeros((len(self._stamps), wires))
        self._count = 0

    def add(self, stamp_ns: int, tension: Sequence[float]) -> None:
        """Take a reading in N, shape (W,); one that is not newer than the last is left out."""
        if self._count and stamp_ns <= self._stamps[self._count - 1]:
            return
        if stamp_ns < self.start_ns - self._period_ns or self._count == len(self._stamps):
            return
        self._stamps[self._count] = stamp_ns
        self._values[self._count] = tension
        self._count += 1

    @property
    def complete(self) -> bool:
        """Whether a reading at or after the last instant has been taken."""
        last = self.start_ns + (self._samples - 1) * self._period_ns
        return self._count > 0 and bool(self._stamps[self._count - 1] >= last)

    def resampled(self) -> Array:
        """Tensions at the instants of the grid by linear interpolation.

        Returns
        -------
        ndarray, shape (N, W)
            In N.

        Raises
        ------
        TensionGapError
            A gap is too long, or too many instants have no reading of their own.
        """
        periods = (self._stamps[: self._count] - self.start_ns) / self._period_ns
        grid = np.arange(self._samples)
        edges = np.concatenate(([-1.0], periods, [float(self._samples)]))
        longest = float(np.max(np.diff(edges)))
        if longest > self._longest_gap:
            where = max(0.0, float(edges[np.argmax(np.diff(edges))])) * self._period_ns * 1e-9
            raise TensionGapError(
                f'no tension for {longest * self._period_ns * 1e-6:.0f} ms from '
                f'{where:.3f} s on; at most {self._longest_gap * self._period_ns * 1e-6:.0f} ms '
                'can be bridged'
            )
        nearest = np.unique(np.floor(periods + 0.5).astype(int))
        present = np.count_nonzero((nearest >= 0) & (nearest < self._samples))
        missing = 1.0 - present / self._samples
        if missing > self._most_missing:
            raise TensionGapError(
                f'{100 * missing:.1f} % of the tensions are missing; at most '
                f'{100 * self._most_missing:g} % can be bridged'
            )
        values = self._values[: self._count]
        return np.stack([np.interp(grid, periods, column) for column in values.T], axis=1)

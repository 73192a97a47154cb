"""Samples of the topics of a rig, and their values at the ticks of a prediction."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SAME_S = 1e-6


@dataclass
class Samples:
    """Samples of one topic in the order of their times, in s."""

    columns: int  # numbers in a sample
    time: Array = field(default_factory=lambda: np.empty(0))  # (N,)
    values: Array = field(init=False)  # (N, columns)

    def __post_init__(self) -> None:
        self.values = np.empty((0, self.columns))

    def append(self, time: ArrayLike, values: ArrayLike) -> None:
        """Add samples at times (N,) in s with values (N, columns)."""
        self.time = np.concatenate([self.time, np.asarray(time, dtype=float)])
        new = np.asarray(values, dtype=float).reshape(-1, self.columns)
        self.values = np.concatenate([self.values, new])

    def clear(self) -> None:
        """Remove all samples."""
        self.time, self.values = self.time[:0], self.values[:0]

    def drop(self, before: float) -> None:
        """Remove all samples before the last one at or before a time."""
        first = max(int(np.searchsorted(self.time, before + _SAME_S, 'right')) - 1, 0)
        self.time, self.values = self.time[first:], self.values[first:]

    @property
    def in_order(self) -> bool:
        """Whether time never goes back."""
        return not (np.diff(self.time) < 0.0).any()

    def flaw(self, begin: float, end: float, longest: float) -> str:
        """Why the samples do not cover an interval, in words; empty if they do."""
        inside = (self.time > begin - longest) & (self.time <= end + _SAME_S)
        times = self.time[inside]
        if not np.isfinite(self.values[inside]).all():
            return 'no numbers'
        if not len(times) or np.diff(times, prepend=begin, append=end).max() > longest:
            return 'silent'
        return ''

    def held(self, time: Array) -> Array:
        """Values in force at times (N,): zero-order hold."""
        last = np.searchsorted(self.time, time + _SAME_S, 'right') - 1
        return self.values[np.maximum(last, 0)]

    def between(self, time: Array) -> Array:
        """Values at times (N,), linearly interpolated."""
        return np.column_stack([np.interp(time, self.time, each) for each in self.values.T])

    def binned(self, begin: float, length: float, bins: int) -> 'Binned':
        """Samples in consecutive bins of a length in s."""
        since = self.time - begin
        place = np.ceil((since - _SAME_S) / length).astype(np.int64) - 1
        inside = (place >= 0) & (place < bins)
        return Binned(self.time[inside], self.values[inside], place[inside], bins)


@dataclass(frozen=True)
class Binned:
    """Samples (N,) with the bin of each."""

    time: Array
    values: Array
    place: NDArray[np.int64]
    bins: int

    def means(self) -> Array:
        """Mean of each bin, (bins, columns), NaN where it is empty."""
        total = np.zeros((self.bins, self.values.shape[1]))
        np.add.at(total, self.place, self.values)
        count = np.bincount(self.place, minlength=self.bins).astype(float)
        return total / np.where(count > 0.0, count, np.nan)[:, None]

    def means_of(self, grid: Array) -> Array:
        """Matrix (bins, G) that maps values on a regular grid (G,) of times to `means`."""
        at = np.clip((self.time - grid[0]) / (grid[1] - grid[0]), 0.0, len(grid) - 1.0)
        left = np.minimum(at.astype(np.int64), len(grid) - 2)
        matrix = np.zeros((self.bins, len(grid)))
        np.add.at(matrix, (self.place, left), 1.0 - (at - left))
        np.add.at(matrix, (self.place, left + 1), at - left)
        return matrix / np.maximum(np.bincount(self.place, minlength=self.bins), 1)[:, None]

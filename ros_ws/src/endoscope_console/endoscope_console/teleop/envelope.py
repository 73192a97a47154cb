"""Smallest, largest and last value of signals between two pictures of them."""

import numpy as np
from numpy.typing import ArrayLike, NDArray


class Envelope:
    """What the samples of an interval come to, so that no peak between two pictures is lost.

    Parameters
    ----------
    count
        Number of signals, N.
    """

    def __init__(self, count: int) -> None:
        self._ranges = np.full((count, 3), np.nan)

    def take(self, k: int, values: ArrayLike) -> None:
        """Take samples of a signal.

        Parameters
        ----------
        k
            Which signal.
        values
            Its samples in their order, shape (M,), in its own unit; NaN is no sample.
        """
        samples = np.asarray(values, dtype=float)
        samples = samples[~np.isnan(samples)]
        if not samples.size:
            return
        low, high, _ = self._ranges[k]
        self._ranges[k] = (
            np.fmin(low, samples.min()),
            np.fmax(high, samples.max()),
            samples[-1],
        )

    def close(self) -> NDArray[np.float64]:
        """End the interval and begin the next.

        Returns
        -------
        array, shape (N, 3)
            Smallest, largest and last sample of each signal; NaN where none came.
        """
        ranges, self._ranges = self._ranges, np.full_like(self._ranges, np.nan)
        return ranges

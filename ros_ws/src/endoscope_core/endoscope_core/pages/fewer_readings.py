"""Fewer numbers that hide no reading: what a page of megabytes draws of a recording of minutes."""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_READINGS = 4000
"""A curve of more readings is drawn as a band of their least and greatest values."""

MOST_BINS = 2000


def banded(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return edges (K + 1,) of stretches, and the least and greatest of y (K,) in each.

    Of x (N,), increasing, neighbours share a reading, so that the band is as connected as the line
    through all readings, and none of these lies outside. NaN in y (N,) is left out; a stretch of
    nothing else is NaN.
    """
    step = math.ceil((len(y) - 1) / MOST_BINS)
    begins = np.arange(0, len(y) - 1, step)
    ends = np.minimum(begins + step, len(y) - 1)
    low = np.fmin(np.fmin.reduceat(y, begins), y[ends])
    high = np.fmax(np.fmax.reduceat(y, begins), y[ends])
    return np.append(x[begins], x[-1]), low, high


def telling(x: Array, y: Array) -> NDArray[np.intp]:
    """Indices of readings that stand for all readings of a loop.

    Of each stretch in time the first, the last, and those of least and greatest x and y.
    """
    step = math.ceil(2 * len(y) / MOST_READINGS)
    while len(kept := _extremes(x, y, step)) > MOST_READINGS:
        step += math.ceil(step / 4)
    return kept


def _extremes(x: Array, y: Array, step: int) -> NDArray[np.intp]:
    kept = {len(y) - 1}
    for begin in range(0, len(y), step):
        end = min(begin + step, len(y))
        kept |= {begin, end - 1}
        for values in (x[begin:end], y[begin:end]):
            known = np.flatnonzero(np.isfinite(values))
            if len(known):
                kept |= {
                    begin + int(known[np.argmin(values[known])]),
                    begin + int(known[np.argmax(values[known])]),
                }
    return np.array(sorted(kept))

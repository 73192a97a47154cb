"""Frequencies of a mismatch."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import periodogram

from endoscope_explain.locate.excess import SignalExcess

Array = NDArray[np.float64]


def band_hz(excess: SignalExcess) -> tuple[float, float]:
    """Find the band in Hz that holds 90 % of what the prediction lacks.

    The lower end is 0 where a constant is part of it.
    """
    time, missing = excess.view.time, excess.missing
    if len(time) < 8:
        return 0.0, 0.0
    period = float(np.median(np.diff(time)))
    grid = np.arange(time[0], time[-1], period)
    frequency, power = periodogram(np.interp(grid, time, missing), 1.0 / period, detrend=False)
    total = power.sum()
    if total <= 0.0:
        return 0.0, 0.0
    cumulative = np.cumsum(power) / total
    low = frequency[np.searchsorted(cumulative, 0.05)]
    high = frequency[min(np.searchsorted(cumulative, 0.95), len(frequency) - 1)]
    return float(low), float(high)

"""Intervals between stamps, gaps and runs among samples, and stamps of another clock."""

from dataclasses import replace

import numpy as np

from endoscope_explain.recording import Array, Mask, Series

GAP_FACTOR = 2.5
"""A gap is at least this many usual sample intervals: one lost sample is not one."""


def usual_interval(time: Array) -> float:
    """Return the median interval of increasing stamps in s."""
    return float(np.median(np.diff(time)))


def find_gaps(series: Series, start: float, end: float) -> tuple[tuple[float, float], ...]:
    """From the last sample before to the first one after each gap, in s."""
    usual = usual_interval(series.time)
    step = np.diff(series.time)
    # A stream that jitters as a matter of course is not full of gaps.
    threshold = max(GAP_FACTOR * usual, 3.0 * float(np.quantile(step, 0.99)))
    at = np.flatnonzero(step > threshold)
    gaps = [(float(series.time[i]), float(series.time[i + 1])) for i in at]
    # A topic that begins late or ends early in the recording has a gap there, too.
    margin = max(threshold, 0.1)
    if series.time[0] - start > margin:
        gaps.insert(0, (start, float(series.time[0])))
    if end - series.time[-1] > margin:
        gaps.append((float(series.time[-1]), end))
    return tuple(gaps)


def retimed(series: Series, skew: float, start: float = 0.0) -> Series:
    """Put a series on the common clock; its own ran `1 + skew` times as fast from `start` s."""
    time: Array = start + (series.time - start) / (1.0 + skew)
    return replace(series, time=time)


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First and last place of each run of true values of a mask (N,) of samples."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask, 0]))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]

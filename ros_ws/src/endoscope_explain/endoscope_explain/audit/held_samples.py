"""Readings that stand still although the sensor's noise never does."""

import math

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.audit.stamps import GAP_FACTOR, usual_interval
from endoscope_explain.recording.series import Array, Mask

Indices = NDArray[np.int64]

COARSE = 0.1
"""Share of repeated readings from which on a sensor is coarser than its noise."""
COARSE_HOLD_S = 1.0
JUMP = 5.0
"""Usual large steps that a reading jumps by when it was held before."""
JUMP_HOLD_S = 0.02


def runs_of_equal(values: Array) -> tuple[Indices, Indices]:
    """Return starts and lengths of the runs of equal consecutive values of a 1-D array."""
    starts = np.flatnonzero(np.r_[True, values[1:] != values[:-1]]).astype(np.int64)
    return starts, np.diff(np.r_[starts, len(values)]).astype(np.int64)


def chance_of_repeat(noise: float, resolution: float) -> float:
    """Return the probability that two noisy, rounded readings of a constant are equal."""
    if noise <= 0.0:
        return 1.0
    return min(1.0, resolution / (2.0 * noise * math.sqrt(math.pi)))


def held(values: Array, noise: float, resolution: float, interval: float) -> tuple[Mask, int]:
    """Samples (N,) that repeat the one before for longer than chance allows, and the usual run.

    The first of each run is none of them. Noise (rms) and step are in the unit of the values (N,),
    the interval is in s. The usual run is longer than 1 where the sensor is published faster than
    it is read.
    """
    starts, lengths = runs_of_equal(values)
    period = int(np.median(lengths))
    usual = float(np.mean(lengths > 1))
    chance = max(chance_of_repeat(noise, resolution), usual, 1e-3)
    if chance > 0.5:
        return np.zeros(len(values), bool), 1
    # A run this long turns up by chance in fewer than one recording in ten thousand.
    bound = math.ceil(math.log(1e-4 / len(values)) / math.log(chance)) + 1
    bound = max(bound, 4 * period, 3)
    if usual > COARSE:
        # This sensor is coarser than described: it may stand still for as long as the rig does.
        bound = max(bound, math.ceil(COARSE_HOLD_S / interval))
    repeated = np.zeros(len(values), bool)
    for start, length in zip(starts, lengths, strict=True):
        if length >= bound:
            repeated[start + 1 : start + length] = True
    return repeated, period


def held_before_jump(time: Array, values: Array, resolution: float) -> Mask:
    """A noiseless sensor's samples (N,), after the first of a run, held until the reading jumps."""
    # A rig that rests starts to move by small steps; a source that repeated an old sample comes
    # back where the rig has gone in the meantime.
    repeated = np.zeros(len(values), bool)
    usual = usual_interval(time)
    starts, lengths = runs_of_equal(values)
    ends = starts[1:] - 1
    step = np.abs(np.diff(values))[ends]
    if not len(step):
        return repeated
    long = time[ends] - time[starts[:-1]] >= max(JUMP_HOLD_S, 4.0 * usual)
    jumps = step > JUMP * max(resolution, float(np.quantile(step, 0.99)))
    whole = np.diff(time)[ends] < GAP_FACTOR * usual
    for run in np.flatnonzero(long & jumps & whole):
        repeated[starts[run] + 1 : starts[run] + lengths[run]] = True
    return repeated


def held_findings(joint: str, signal: str, time: Array, repeated: Mask) -> list[Finding]:
    """Describe the repeated samples of one signal, if any; a note while they are few."""
    if not repeated.any():
        return []
    starts = np.flatnonzero(repeated & ~np.r_[False, repeated[:-1]])
    ends = np.flatnonzero(repeated & ~np.r_[repeated[1:], False])
    spans = tuple((float(time[a - 1]), float(time[b])) for a, b in zip(starts, ends, strict=True))
    longest = max(b - a for a, b in spans)
    severity = Severity.FAULT if longest > max(0.05, 4 * usual_interval(time)) else Severity.NOTE
    return [
        Finding(
            'held_samples',
            severity,
            joint,
            'recording',
            (signal,),
            spans,
            f'{signal} repeats an old sample for up to {longest:.3f} s, first from '
            f'{spans[0][0]:.3f} s',
            'repeated samples are not judged',
            evidence={'count': float(repeated.sum()), 'longest_s': longest},
        )
    ]

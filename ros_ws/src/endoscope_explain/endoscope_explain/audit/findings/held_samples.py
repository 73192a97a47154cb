"""Readings that repeat an old sample."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.audit.examined import GAP_FACTOR, Examined, runs, usual_interval
from endoscope_explain.audit.finding import Column, Finding, FindingKind, Severity
from endoscope_explain.recording import Array, Mask, RigRecording, Series

KIND = FindingKind(
    'held_samples',
    Severity.NOTE,
    '{signals} repeats an old sample for up to {longest_s:.3f} s, first from {begin:.3f} s',
    'repeated samples are not judged',
)
LONG = replace(KIND, severity=Severity.FAULT)
LONG_S = 0.05
COARSE = 0.1
"""Share of repeated readings from which on a sensor is coarser than its noise."""
COARSE_HOLD_S = 1.0
JUMP = 5.0
"""Usual large steps that a reading jumps by when it was held before."""
JUMP_HOLD_S = 0.02


def find(seen: Examined) -> Examined:
    """Leave out what the motors' positions, the load cells and the tracker repeat."""
    recording, found, changed = seen.recording, [], {}
    for quantity, series in recording.measured().items():
        repeated = _repeated(quantity, series, seen)
        if repeated is None:
            continue
        for place, column in enumerate(repeated.T):
            if column.any():
                found.append(_finding(recording, (quantity, place), series.time, column))
        for name, other in recording.measured().items():
            # Position, velocity and effort of the motor come in the same messages.
            if other.topic == series.topic:
                changed[name] = other.without(repeated.reshape(other.valid.shape))
    return seen.found(*found, recording=recording.with_series(changed))


def _repeated(quantity: str, series: Series, seen: Examined) -> Mask | None:
    """Samples (N, columns) of a quantity that repeat an old one; None where none is judged."""
    sensors = seen.plant.sensors
    columns = series.values.reshape(len(series.time), -1).T
    if quantity == 'shaft_position':
        step = 2.0 * np.pi / sensors.encoder_counts
        return np.stack([_held_before_jump(series.time, one, step) for one in columns], axis=1)
    noise = {
        'tension': (sensors.load_cell_noise, sensors.load_cell_resolution),
        'bending': (sensors.tracker_noise, 0.0),
    }
    # A reading without noise, as of a simulation, may well repeat itself.
    if quantity not in noise or not seen.noisy:
        return None
    interval = usual_interval(series.time)
    held = np.stack([_held(one, *noise[quantity], interval) for one in columns], axis=1)
    return held & series.valid.reshape(held.shape)


def _finding(recording: RigRecording, column: Column, time: Array, repeated: Mask) -> Finding:
    """What one column repeats, of stamps (N,) in s; a note while it is short."""
    spans = [(float(time[a - 1]), float(time[b])) for a, b in runs(repeated)]
    longest = max(b - a for a, b in spans)
    kind = LONG if longest > max(LONG_S, 4 * usual_interval(time)) else KIND
    evidence = {'count': float(repeated.sum()), 'longest_s': longest}
    return kind.found(recording, [column], spans, evidence=evidence)


def _held(values: Array, noise: float, resolution: float, interval: float) -> Mask:
    """Samples (N,) that repeat the one before for longer than chance allows."""
    # The first of each run is none of them. Noise (rms) and step are in the unit of the values
    # (N,), the interval is in s. The usual run is longer than 1 where the sensor is published
    # faster than it is read.
    repeated = np.zeros(len(values), bool)
    starts, lengths = _runs_of_equal(values)
    usual = float(np.mean(lengths > 1))
    # That two noisy, rounded readings of a constant are equal.
    equal = resolution / (2.0 * noise * math.sqrt(math.pi)) if noise > 0.0 else 1.0
    chance = max(min(1.0, equal), usual, 1e-3)
    if chance > 0.5:
        return repeated
    # A run this long turns up by chance in fewer than one recording in ten thousand.
    bound = math.ceil(math.log(1e-4 / len(values)) / math.log(chance)) + 1
    bound = max(bound, 4 * int(np.median(lengths)), 3)
    if usual > COARSE:
        # This sensor is coarser than described: it may stand still for as long as the rig does.
        bound = max(bound, math.ceil(COARSE_HOLD_S / interval))
    for start, length in zip(starts, lengths, strict=True):
        if length >= bound:
            repeated[start + 1 : start + length] = True
    return repeated


def _held_before_jump(time: Array, values: Array, resolution: float) -> Mask:
    """A noiseless sensor's samples (N,), after the first of a run, held until the reading jumps."""
    # A rig that rests starts to move by small steps; a source that repeated an old sample comes
    # back where the rig has gone in the meantime.
    repeated = np.zeros(len(values), bool)
    usual = usual_interval(time)
    starts, lengths = _runs_of_equal(values)
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


def _runs_of_equal(values: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Starts and lengths of the runs of equal consecutive values (N,)."""
    starts = np.flatnonzero(np.r_[True, values[1:] != values[:-1]]).astype(np.int64)
    return starts, np.diff(np.r_[starts, len(values)]).astype(np.int64)

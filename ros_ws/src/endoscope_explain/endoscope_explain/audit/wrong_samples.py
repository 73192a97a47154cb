"""Samples that must not be judged: readings that are held, clipped, or isolated and wrong."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, poisson

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.audit.stamps import GAP_FACTOR, usual_interval
from endoscope_explain.explanation import NINETY_PERCENT, Estimate
from endoscope_explain.recording import Array, Mask, Series, signal_name

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
    """Samples (N,) that repeat the one before for longer than chance allows, and the usual run."""
    # The first of each run is none of them. Noise (rms) and step are in the unit of the values
    # (N,), the interval is in s. The usual run is longer than 1 where the sensor is published
    # faster than it is read.
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


def clipped(values: Array, noise: float, resolution: float) -> tuple[Mask, float] | None:
    """Find readings (N,) at the limit of a clipped cell, and the limit in N; None if none clips."""
    top = float(values.max())
    step = resolution if resolution > 0 else 1e-9 * max(1.0, abs(top))
    # Readings of an unclipped cell thin out towards their maximum; those of a clipped one pile up
    # there. The pile is looked for in steps of the cell's resolution.
    at_limit = values >= top - 0.5 * step
    pile = int(at_limit.sum())
    if pile < 20:
        return None
    # How many readings fall into the steps just below, where the same signal is not clipped.
    width = max(10 * step, noise)
    below = int(((values < top - 0.5 * step) & (values >= top - width)).sum())
    usual_in_a_step = below * step / width
    if pile < 10 * usual_in_a_step + 20:
        return None
    return at_limit, top


def saturation_finding(
    joint: str,
    signal: str,
    time: Array,
    at_limit: Mask,
    limit: float,
    resolution: float,
    wire: int,
) -> Finding:
    """Describe the `load_cell_saturation` of one wire (0: positive, 1: negative)."""
    edges = np.flatnonzero(np.diff(np.r_[False, at_limit, False].astype(int)))
    # Noise dips below the limit: passages closer than 0.1 s are one.
    spans: list[tuple[float, float]] = []
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        begin, end = float(time[a]), float(time[b - 1])
        if spans and begin - spans[-1][1] < 0.1:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((begin, end))
    return Finding(
        showing(Symptom.CLIPPED_TENSION).id,
        Severity.FAULT,
        joint,
        'sensing',
        (signal,),
        tuple(spans),
        f'{signal} clips at {limit:.3f} N in {int(at_limit.sum())} samples',
        'clipped samples are not judged',
        parameters={
            'limit_n': Estimate(limit, limit - resolution, limit + resolution, 'N'),
            'wire': Estimate(float(wire), float(wire), float(wire), '-'),
        },
        evidence={'count': float(at_limit.sum())},
    )


TRAVEL_FACTOR = 1.5
"""A spike is no motion of the joint where it exceeds the motor's travel by this factor."""


def spike_heights(values: Array, width: int = 1) -> Array:
    """How far samples (N,) stick out, up to `width` in a row, with the sign of the spike."""
    if len(values) < width + 2:
        return np.zeros(len(values))
    # The smaller distance of the first and the last of a row to the samples beside it where both
    # stick out to the same side, else 0. A sample that belongs to several rows has the largest.
    before = values[1:-width] - values[: -width - 1]
    after = values[width:-1] - values[width + 1 :]
    same_side = before * after > 0
    height = np.where(same_side, np.sign(before) * np.minimum(abs(before), abs(after)), 0.0)
    heights = np.zeros(len(values))
    for place in range(width):
        heights = _larger(heights, np.r_[np.zeros(place + 1), height, np.zeros(width - place)])
    return heights


def _larger(one: Array, other: Array) -> Array:
    return np.where(np.abs(one) > np.abs(other), one, other)


def spike_chance(height: Array, noise: float) -> Array:
    """Return the probability that white noise (rms `noise`) makes a spike of at least |height|."""
    # For three independent normal readings of a constant: integral over the middle one of both
    # neighbours lying beyond it by `height`, on either side.
    grid = np.linspace(-10.0, 10.0, 801)
    weight = norm.pdf(grid) * (grid[1] - grid[0])
    h = np.abs(np.asarray(height, float)) / noise
    levels = np.linspace(0.0, 20.0, 401)
    # Squares far in the tail underflow to 0, which is the answer wanted.
    chance = np.array([2.0 * np.sum(weight * norm.cdf(grid - level) ** 2) for level in levels])
    return np.where(h > 0, np.exp(np.interp(h, levels, np.log(np.maximum(chance, 1e-300)))), 1.0)


def find_outliers(values: Array, noise: float, travel: Array) -> Mask:
    """Samples (N,) in rad that stick out as noise (rms) and motion never do, beyond chance."""
    # Travel is the motor's (N,), in rad of the joint; gaps between the readings must not matter.
    wrong = np.zeros(len(values), bool)
    if len(values) < 20:
        return wrong
    scale = max(noise, _quiet_noise(values))
    coarse = _step_of_coarse(values)
    # A bending section may jump there and back within three samples where its motor does: a spike
    # counts only where it is larger than the motor's travel around it, and where it stands alone
    # against the signal's own roughness nearby.
    for _ in range(3):
        kept = np.flatnonzero(~wrong)
        heights = _larger(spike_heights(values[kept], 2), spike_heights(values[kept]))
        roughness = _roughness_nearby(heights)
        chance = spike_chance(heights, scale)
        beyond = np.maximum(3.0 * roughness, TRAVEL_FACTOR * np.maximum(travel[kept], coarse))
        lonely = np.abs(heights) > beyond
        bound = 1e-6
        found = (chance < bound) & lonely
        surprising = poisson.sf(found.sum() - 1, len(kept) * bound) < 1e-4 if found.any() else False
        if not surprising:
            break
        wrong[kept[found | ((chance < 1e-4) & lonely)]] = True
    return wrong


def motor_travel(tracker_time: Array, motor_time: Array, motor_angle: Array, reach: float) -> Array:
    """Range (N,) of the motor's angle (M,), in rad of the joint, within `reach` s of samples."""
    first = np.searchsorted(motor_time, tracker_time - reach)
    last = np.searchsorted(motor_time, tracker_time + reach)
    last = np.maximum(last, first + 1)
    padded = np.r_[motor_angle, motor_angle[-1]]
    bounds = np.minimum(np.c_[first, last].ravel(), len(motor_angle))
    highest = np.maximum.reduceat(padded, bounds)[::2]
    lowest = np.minimum.reduceat(padded, bounds)[::2]
    return np.asarray(highest - lowest)


def outlier_finding(joints: Sequence[str], series: Series, wrong: Mask) -> Finding:
    """`tracker_outliers` of the joint with most wrong samples (N, J): one tracker reads all."""
    sizes = []
    for j in range(len(joints)):
        bad, values = wrong[:, j], series.values[:, j]
        truth = np.interp(series.time[bad], series.time[~bad], values[~bad])
        sizes.append(np.abs(values[bad] - truth))
    size = np.concatenate(sizes)
    count, n = int(wrong.any(axis=1).sum()), len(wrong)
    share, spread = count / n, NINETY_PERCENT * np.sqrt(count) / n
    typical = float(np.sqrt(np.mean(size**2)))
    worst = int(np.argmax(wrong.sum(axis=0)))
    affected = [name for j, name in enumerate(joints) if wrong[:, j].any()]
    signals = tuple(signal_name('bending', name) for name in affected)
    return Finding(
        showing(Symptom.WRONG_SAMPLES).id,
        Severity.FAULT,
        joints[worst],
        'sensing',
        signals,
        tuple((float(t), float(t)) for t in series.time[wrong.any(axis=1)]),
        f'{count} of {n} samples of {" and ".join(signals)} are isolated and wrong, by '
        f'{np.degrees(typical):.1f} deg rms',
        'wrong samples are not judged',
        parameters={
            'rate': Estimate(share, max(share - spread, 0.0), share + spread, '-'),
            'size_rad': Estimate(typical, float(size.min()), float(size.max()), 'rad'),
        },
        evidence={'count': float(count)},
    )


def _quiet_noise(values: Array) -> float:
    # The interpolation error of a cubic through the four neighbours is noise times sqrt(1 + 34/36)
    # where the signal is smooth; the median ignores what is not.
    inner = values[2:-2] - (4.0 * (values[1:-3] + values[3:-1]) - (values[:-4] + values[4:])) / 6.0
    return float(np.median(np.abs(inner)) / 0.6745 / np.sqrt(1.0 + 34.0 / 36.0))


def _step_of_coarse(values: Array) -> float:
    """Smallest step of a reading that is coarser than its noise, by which it may go to and fro."""
    steps = np.abs(np.diff(values))
    if np.mean(steps == 0.0) <= COARSE or not steps.any():
        return 0.0
    return float(np.min(steps[steps > 0.0]))


def _roughness_nearby(heights: Array, reach: int = 6) -> Array:
    """Return the second largest |spike| within `reach` samples of every sample."""
    size = np.abs(heights)
    padded = np.pad(size, reach)
    around = np.stack(
        [padded[reach + k : reach + k + len(size)] for k in range(-reach, reach + 1) if abs(k) > 1]
    )
    return np.partition(around, -2, axis=0)[-2]

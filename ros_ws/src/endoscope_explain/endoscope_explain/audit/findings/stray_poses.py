"""Tracker samples that are isolated and wrong."""

import numpy as np
from scipy.stats import norm, poisson

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.examined import Examined, usual_interval
from endoscope_explain.audit.finding import Finding, FindingKind, Severity
from endoscope_explain.audit.findings.held_samples import COARSE
from endoscope_explain.audit.plausibility import NORMAL_MEDIAN
from endoscope_explain.explanation import NINETY_PERCENT, Estimate
from endoscope_explain.recording import Array, Mask, RigRecording

KIND = FindingKind(
    showing(Symptom.WRONG_SAMPLES).id,
    Severity.FAULT,
    '{count:.0f} of {samples} samples of {signals} are isolated and wrong, by {degrees:.1f} deg '
    'rms',
    'wrong samples are not judged',
    'sensing',
)
TRAVEL_FACTOR = 1.5
"""A spike is no motion of the joint where it exceeds the motor's travel by this factor."""


def find(seen: Examined) -> Examined:
    """Leave out the samples of all angles: they come from one pose."""
    recording, series = seen.recording, seen.recording.bending
    motor = recording.shaft_position or recording.command
    noise, reach = seen.plant.sensors.tracker_noise, 3.0 * usual_interval(series.time)
    isolated = []
    for values, shaft in zip(series.values.T, motor.values.T, strict=True):
        travel = _motor_travel(series.time, motor.time, shaft / recording.gear, reach)
        isolated.append(_outliers(values, noise, travel))
    wrong = np.stack(isolated, axis=1)
    if not wrong.any():
        return seen
    bending = series.without(wrong.any(axis=1, keepdims=True))
    found = _finding(recording, wrong)
    return seen.found(found, recording=recording.with_series({'bending': bending}))


def _finding(recording: RigRecording, wrong: Mask) -> Finding:
    """One finding, of the joint with most wrong samples (N, J): one tracker reads all."""
    series = recording.bending
    sizes = []
    for bad, values in zip(wrong.T, series.values.T, strict=True):
        truth = np.interp(series.time[bad], series.time[~bad], values[~bad])
        sizes.append(np.abs(values[bad] - truth))
    size, anywhere = np.concatenate(sizes), wrong.any(axis=1)
    count, n = int(anywhere.sum()), len(wrong)
    share, spread = count / n, NINETY_PERCENT * np.sqrt(count) / n
    typical = float(np.sqrt(np.mean(size**2)))
    return KIND.found(
        recording,
        [('bending', j) for j, bad in enumerate(wrong.T) if bad.any()],
        [(float(t), float(t)) for t in series.time[anywhere]],
        joint=recording.joints[int(np.argmax(wrong.sum(axis=0)))],
        samples=n,
        degrees=np.degrees(typical),
        parameters={
            'rate': Estimate(share, max(share - spread, 0.0), share + spread, '-'),
            'size_rad': Estimate(typical, float(size.min()), float(size.max()), 'rad'),
        },
        evidence={'count': float(count)},
    )


def _outliers(values: Array, noise: float, travel: Array) -> Mask:
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
        heights = _larger(_spike_heights(values[kept], 2), _spike_heights(values[kept]))
        roughness = _roughness_nearby(heights)
        chance = spike_chance(heights, scale)
        beyond = np.maximum(3.0 * roughness, TRAVEL_FACTOR * np.maximum(travel[kept], coarse))
        lonely = np.abs(heights) > beyond
        bound = 1e-6
        found = (chance < bound) & lonely
        if not found.any() or poisson.sf(found.sum() - 1, len(kept) * bound) >= 1e-4:
            break
        wrong[kept[found | ((chance < 1e-4) & lonely)]] = True
    return wrong


def _motor_travel(
    tracker_time: Array, motor_time: Array, motor_angle: Array, reach: float
) -> Array:
    """Range (N,) of the motor's angle (M,), in rad of the joint, within `reach` s of samples."""
    first = np.searchsorted(motor_time, tracker_time - reach)
    last = np.searchsorted(motor_time, tracker_time + reach)
    last = np.maximum(last, first + 1)
    padded = np.r_[motor_angle, motor_angle[-1]]
    bounds = np.minimum(np.c_[first, last].ravel(), len(motor_angle))
    highest = np.maximum.reduceat(padded, bounds)[::2]
    lowest = np.minimum.reduceat(padded, bounds)[::2]
    return np.asarray(highest - lowest)


def _spike_heights(values: Array, width: int = 1) -> Array:
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


def _quiet_noise(values: Array) -> float:
    # The interpolation error of a cubic through the four neighbours is noise times sqrt(1 + 34/36)
    # where the signal is smooth; the median ignores what is not.
    inner = values[2:-2] - (4.0 * (values[1:-3] + values[3:-1]) - (values[:-4] + values[4:])) / 6.0
    return float(np.median(np.abs(inner)) / NORMAL_MEDIAN / np.sqrt(1.0 + 34.0 / 36.0))


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

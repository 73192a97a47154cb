"""Periods with which what a fit leaves repeats over time or another state."""

import numpy as np
from scipy.fft import next_fast_len, rfft
from scipy.signal import find_peaks

from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array

# Periods are peaks of the residuals' periodogram (Lomb, Astrophys. Space Sci. 39, 1976; Scargle,
# Astrophys. J. 263, 1982): a period must be nearly right before a function of it shows at all.


PERIODS = 6
"""Periods of a state that are tried."""
CYCLES = 2.0
"""Fewest cycles within what is visited: what repeats less often is a function like others."""
HARMONICS = 3
"""Of the shortest period, so many are below the Nyquist frequency of the slowest sensor."""
_PER_RESOLVED = 5.0
"""Frequencies that are looked at in the width of a peak (VanderPlas, ApJS 236, 2018)."""
_PER_CYCLE = 8.0
"""Grid points in the shortest period: the spread over two neighbours damps it by 5 %."""


def period_bounds(observation: JointObservation, state: Array) -> tuple[float, float]:
    """Shortest and longest period that a recording shows of a state (N,); none where they cross."""
    slowest = min(observation.channels, key=lambda channel: len(channel.time))
    steps = np.abs(np.diff(_at(observation, state, slowest.time)))
    moving = steps[steps > 1e-3 * steps.max()] if len(steps) and steps.max() > 0.0 else steps
    shortest = 2.0 * HARMONICS * float(np.median(moving)) if len(moving) else np.inf
    return shortest, float(np.ptp(state)) / CYCLES


def likely_periods(observation: JointObservation, residuals: Array, state: Array) -> list[float]:
    """Periods of a state (N,) with which weighted residuals (size,) repeat, best first."""
    shortest, longest = period_bounds(observation, state)
    if shortest >= longest:
        return []
    width = 1.0 / float(np.ptp(state))
    found = []
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        left = residuals[part] - np.mean(residuals[part])
        if not np.any(left):
            continue
        at = _at(observation, state, channel.time)
        frequencies, shares = periodogram(at, left, shortest, longest)
        gains = -0.5 * len(left) * np.log1p(-np.minimum(shares, 1.0 - 1e-12))
        peaks, _ = find_peaks(np.concatenate([[0.0], gains, [0.0]]))
        found += [(float(gains[k - 1]), float(frequencies[k - 1])) for k in peaks]
    chosen: list[float] = []
    for _, frequency in sorted(found, reverse=True):
        if all(abs(frequency - other) > width for other in chosen):
            chosen.append(frequency)
    return [1.0 / frequency for frequency in chosen[:PERIODS]]


def periodogram(at: Array, values: Array, shortest: float, longest: float) -> tuple[Array, Array]:
    """Shares (F,) of the squares that a sinusoid takes away, at frequencies (F,) of a state."""
    # Sums over samples anywhere become Fourier transforms once each sample is spread over its
    # neighbours on a grid (Press, Rybicki, Astrophys. J. 338, 1989).
    span = max(float(np.ptp(at)), longest)
    # Twice the highest frequency is in it, for the sums of products.
    size = next_fast_len(int(_PER_RESOLVED * span * _PER_CYCLE / shortest) + 1, real=True)
    spacing = _PER_RESOLVED * span / size
    place = (at - np.min(at)) / spacing
    below = place.astype(np.int64)
    share = place - below

    def transform(weight: Array) -> Array:
        grid = np.bincount(below, (1.0 - share) * weight, size)
        grid += np.bincount(below + 1, share * weight, size)[:size]
        return np.asarray(rfft(grid))

    k = np.arange(
        int(np.ceil(_PER_RESOLVED * span / longest)), int(_PER_RESOLVED * span / shortest)
    )
    ours, window = transform(values)[k], transform(np.ones(len(values)))[2 * k]
    c, s = ours.real, -ours.imag
    cc, ss = 0.5 * (len(at) + window.real), 0.5 * (len(at) - window.real)
    cs = -0.5 * window.imag
    taken = (ss * c**2 + cc * s**2 - 2.0 * cs * c * s) / np.maximum(cc * ss - cs**2, 1e-12)
    return k / (_PER_RESOLVED * span), taken / float(values @ values)


def _at(observation: JointObservation, state: Array, time: Array) -> Array:
    ticks = observation.tick * np.arange(1, len(state) + 1)
    return np.interp(time, ticks, state)

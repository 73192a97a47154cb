"""Periods with which what a fit leaves repeats itself, in time or in another state.

They are peaks of the residuals' periodogram (Lomb, Astrophys. Space Sci. 39, 1976; Scargle,
Astrophys. J. 263, 1982): a period must be nearly right before a function of it shows at all.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, lombscargle

from endoscope_explain.observe.observation import JointObservation

Array = NDArray[np.float64]

PERIODS = 6
"""Periods of a state that are tried."""
CYCLES = 2.0
"""Fewest cycles within what is visited: what repeats less often is a function like others."""
HARMONICS = 3
"""Of the shortest period, so many are below the Nyquist frequency of the slowest sensor."""
_PER_RESOLVED = 5.0
"""Frequencies that are looked at in the width of a peak (VanderPlas, ApJS 236, 2018)."""


def period_bounds(observation: JointObservation, state: Array) -> tuple[float, float]:
    """Shortest and longest period that a recording tells of a state.

    Parameters
    ----------
    observation : JointObservation
    state : array (N,)
        On its ticks.

    Returns
    -------
    (float, float)
        The shortest is no less than the longest where there is none.
    """
    slowest = min(observation.channels, key=lambda channel: len(channel.time))
    steps = np.abs(np.diff(_at(observation, state, slowest.time)))
    moving = steps[steps > 1e-3 * steps.max()] if len(steps) and steps.max() > 0.0 else steps
    shortest = 2.0 * HARMONICS * float(np.median(moving)) if len(moving) else np.inf
    return shortest, float(np.ptp(state)) / CYCLES


def likely_periods(observation: JointObservation, residuals: Array, state: Array) -> list[float]:
    """Periods of a state with which residuals repeat themselves, the most telling first.

    Parameters
    ----------
    observation : JointObservation
    residuals : array (size,)
        Weighted, without what the fitted numbers could take away.
    state : array (N,)
        On ticks.

    Returns
    -------
    list of float
        `PERIODS` at most.
    """
    shortest, longest = period_bounds(observation, state)
    if shortest >= longest:
        return []
    width = 1.0 / float(np.ptp(state))
    frequencies = np.arange(1.0 / longest, 1.0 / shortest, width / _PER_RESOLVED)
    if len(frequencies) < 3:
        return []
    found = []
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        left = residuals[part] - np.mean(residuals[part])
        if not np.any(left):
            continue
        at = _at(observation, state, channel.time)
        shares = lombscargle(at, left, 2.0 * np.pi * frequencies, normalize=True)
        gains = -0.5 * len(left) * np.log1p(-np.minimum(shares, 1.0 - 1e-12))
        peaks, _ = find_peaks(np.concatenate([[0.0], gains, [0.0]]))
        found += [(float(gains[k - 1]), float(frequencies[k - 1])) for k in peaks]
    chosen: list[float] = []
    for _, frequency in sorted(found, reverse=True):
        if all(abs(frequency - other) > width for other in chosen):
            chosen.append(frequency)
    return [1.0 / frequency for frequency in chosen[:PERIODS]]


def _at(observation: JointObservation, state: Array, time: Array) -> Array:
    ticks = observation.tick * np.arange(1, len(state) + 1)
    return np.interp(time, ticks, state)

"""How much of a reading no lag, offset and scale of real rigs make of a simulated one."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from endoscope_explain.recording import Array

PERIOD_S = 0.02
"""Between the samples that are compared."""
LONGEST_S = 90.0
"""Motion that is compared: ten times the shortest calibration."""
LAGS_S = (0.0, 0.02, 0.04, 0.06, 0.1, 0.14, 0.2, 0.3, 0.4, 0.5)
"""Up to the longest delay of the catalogue."""


@dataclass(frozen=True)
class Criteria:
    """Numbers by which mistakes are judged, derived from recordings in which none was made."""

    # Least and largest scale from a simulated signal of each quantity to one of another rig.
    scales: Mapping[str, tuple[float, float]]
    # Misfit that half of a quantity's signals exceed: nothing is learnt from less.
    usual: Mapping[str, float]
    follows: float  # misfit of a shaft that follows its command
    least_tension: float  # mean in N below which no cell reads
    worth: float  # independent samples that a signal's misfit stands for


@dataclass(frozen=True)
class Bounds:
    """What real rigs make of a simulated quantity."""

    scale: tuple[float, float]  # least and largest
    reach: float  # from the lowest to the highest value that it can have
    noise: float  # of the sensor as described
    scatter: Array  # (M,), of the reading from sample to sample, in its own unit
    least: float  # mean below which it never is: a wire cannot push


@dataclass(frozen=True)
class Moments:
    """Second moments of M measured and P simulated columns, the latter at L lags."""

    mean: Array  # (M,)
    variance: Array  # (M,)
    reach: Array  # (M,), from low to high
    simulated_mean: Array  # (L, P)
    simulated_variance: Array  # (L, P)
    covariance: Array  # (L, M, P)

    @staticmethod
    def of(measured: Array, simulated: Array) -> 'Moments':
        """Of arrays (N, M) and (N, P) on one grid."""
        lags = [round(lag / PERIOD_S) for lag in LAGS_S]
        late = measured[lags[-1] :]
        early = np.stack([simulated[lags[-1] - lag : len(simulated) - lag] for lag in lags])
        reach = np.ptp(np.quantile(late, (0.01, 0.99), axis=0), axis=0)
        mean, simulated_mean = late.mean(axis=0), early.mean(axis=1)
        late, early = late - mean, early - simulated_mean[:, None]
        return Moments(
            mean,
            (late**2).mean(axis=0),
            reach,
            simulated_mean,
            (early**2).mean(axis=1),
            np.matmul(late.T, early) / len(late),
        )

    def misfit(self, factor: float, bounds: Bounds) -> Array:
        """Share of each measured column that no lag, offset and scale make of a simulated one."""
        # Gives the share, 0 where they agree and 1 where they have nothing in common, and the
        # scale: (2, M, P). `factor` is the reading of one SI unit.
        mean, variance = self.mean / factor, (self.variance / factor**2)[:, None]
        covariance, power = self.covariance / factor, self.simulated_variance[:, None, :]
        best = np.clip(covariance / np.maximum(power, 1e-300), *bounds.scale)
        left = variance - 2.0 * best * covariance + best**2 * power
        if np.isfinite(bounds.least):
            highest = (1.0 + bounds.scale[1]) * self.simulated_mean[:, None, :]
            left = left + np.maximum(bounds.least - mean, 0.0)[:, None] ** 2
            left = left + np.maximum(mean[:, None] - highest, 0.0) ** 2
        left = left + np.maximum((self.reach / abs(factor))[:, None] - bounds.reach, 0.0) ** 2
        # What a unit makes small must not pass for noise, unless the reading is as noisy in it.
        spread = np.full((len(mean), 1), bounds.noise)
        if abs(factor) > 1.0:
            spread = np.minimum(spread, bounds.scatter[:, None] / abs(factor))
        floor = (3.0 * spread) ** 2
        share = np.sqrt(np.maximum(left, 0.0) / (variance + floor + 1e-300))
        lag = share.argmin(axis=0)[None]
        return np.stack([np.take_along_axis(of, lag, 0)[0] for of in (share, best)])

    def size(self) -> Array:
        """Times that each measured column is as large as its simulated one, where they agree."""
        power = np.maximum(self.simulated_variance, 1e-300)
        alike = np.einsum('lmm->lm', self.covariance) / np.sqrt(
            np.maximum(power * self.variance, 1e-300)
        )
        lag = alike.argmax(axis=0)
        column = np.arange(len(self.mean))
        return np.sqrt(self.variance / power[lag, column]) * (alike.max(axis=0) > 0.0)

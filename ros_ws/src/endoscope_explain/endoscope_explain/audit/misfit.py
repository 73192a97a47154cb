"""How much of a reading no lag, offset and scale of real rigs make of a simulated one."""

from dataclasses import dataclass

import numpy as np

from endoscope_explain.recording import Array

PERIOD_S = 0.02
"""Between the samples that are compared."""
LONGEST_S = 90.0
"""Motion that is compared: ten times the shortest calibration."""
LAGS_S = (0.0, 0.02, 0.04, 0.06, 0.1, 0.14, 0.2, 0.3, 0.4, 0.5)
"""Up to the longest delay of the catalogue."""
TURN_RAD = 2.0 * np.pi
"""No section bends further, from one side to the other."""

# Derived once from recordings without mistakes, seeds 2001 to 2240 of `endoscope bench mistakes`.
SCALES = {
    'shaft_position': (0.995, 1.0),
    'shaft_velocity': (0.914, 1.03),
    'shaft_effort': (0.581, 1.77),
    'tension': (0.592, 1.84),
    'bending': (0.0, 1.89),
}
"""Least and largest scale from a simulated signal of each quantity to one of another rig."""
USUAL = {
    'shaft_position': 0.0125,
    'shaft_velocity': 0.0305,
    'shaft_effort': 0.117,
    'tension': 0.147,
    'bending': 0.24,
}
"""Misfit that half of a quantity's signals exceed: nothing is learnt from less."""
FOLLOWS = 0.0551
"""Misfit of a shaft that follows its command."""
LEAST_TENSION = -0.563
"""Mean in N below which no cell reads."""
WORTH = 4.86
"""Independent samples that a signal's misfit stands for."""


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

    def misfit(self, factor: float, quantity: str, noise: float, scatter: Array) -> Array:
        """Share of each measured column that no lag, offset and scale make of a simulated one."""
        # Gives the share, 0 where they agree and 1 where they have nothing in common, and the
        # scale: (2, M, P). `factor` is the reading of one SI unit; `noise` is of the sensor as
        # described, and `scatter` (M,) of the reading from sample to sample, in its own unit.
        mean, variance = self.mean / factor, (self.variance / factor**2)[:, None]
        covariance, power = self.covariance / factor, self.simulated_variance[:, None, :]
        best = np.clip(covariance / np.maximum(power, 1e-300), *SCALES[quantity])
        left = variance - 2.0 * best * covariance + best**2 * power
        if quantity == 'tension':
            # A wire cannot push.
            highest = (1.0 + SCALES[quantity][1]) * self.simulated_mean[:, None, :]
            left = left + np.maximum(LEAST_TENSION - mean, 0.0)[:, None] ** 2
            left = left + np.maximum(mean[:, None] - highest, 0.0) ** 2
        if quantity == 'bending':
            left = left + np.maximum((self.reach / abs(factor))[:, None] - TURN_RAD, 0.0) ** 2
        # What a unit makes small must not pass for noise, unless the reading is as noisy in it.
        spread = np.full((len(mean), 1), noise)
        if abs(factor) > 1.0:
            spread = np.minimum(spread, scatter[:, None] / abs(factor))
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

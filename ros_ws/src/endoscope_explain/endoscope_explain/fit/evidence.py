"""The evidence for a fitted joint: one number by which everything that may be missing competes.

It is Laplace's approximation of the marginal likelihood (MacKay, Neural Computation 4, 1992), with
the variance of each channel as it is left, but never below the sensor's own. A flexible term pays
for what it could have explained and did not; no penalty is set by hand.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit
from endoscope_explain.observe.observation import JointObservation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Misfit:
    """Misfit of one joint.

    `channels` (C,): mean squared residual of each channel in noise units.
    `total`: sum over all samples, in noise units.
    """

    channels: Array
    total: float


def misfit(found: Fit) -> Misfit:
    """Misfit of a fitted joint, channel by channel."""
    squares = mean_squares(found.model.observation, found.residuals)
    return Misfit(squares, float(np.sum(found.residuals**2)))


def mean_squares(observation: JointObservation, residuals: Array) -> Array:
    """Mean square (C,) of the residuals (size,) of each channel, in noise units."""
    return np.array([float(np.mean(residuals[part] ** 2)) for part in observation.slices()])


def weights(observation: JointObservation, residuals: Array) -> Array:
    """Inverse (size,) of what each channel is off by, in its noise; 1 where that is less."""
    weight = np.empty(len(residuals))
    for part, square in zip(
        observation.slices(), mean_squares(observation, residuals), strict=True
    ):
        weight[part] = 1.0 / math.sqrt(max(1.0, square))
    return weight


def log_likelihood(squares: Array, counts: Array) -> float | Array:
    """Logarithm of the likelihood of channels with their variance as it is left.

    `squares` (..., C): mean squares in noise units.
    `counts` (C,): samples of each channel.
    Returns (...).
    """
    variance = np.maximum(squares, 1.0)
    return -0.5 * np.sum(counts * (np.log(variance) + squares / variance), axis=-1)


def counts(observation: JointObservation) -> Array:
    """Samples (C,) of each channel."""
    return np.array([float(part.stop - part.start) for part in observation.slices()])


def log_evidence(found: Fit) -> float:
    """Logarithm of the evidence for a fitted joint, but for what is the same for all its models."""
    model = found.model
    observation = model.observation
    squares = mean_squares(observation, found.residuals)
    prior = model.prior(found.theta)
    precision = _prior_precision(found)
    weighted = found.jacobian * weights(observation, found.residuals)[:, None]
    _, posterior = np.linalg.slogdet(weighted.T @ weighted + np.diag(precision))
    volume = 0.5 * (float(np.sum(np.log(precision))) - float(posterior))
    return float(log_likelihood(squares, counts(observation))) - 0.5 * float(prior @ prior) + volume


def _prior_precision(found: Fit) -> Array:
    """Inverse variance of each coordinate before any data; spread evenly if it has no prior."""
    low, high = found.model.bounds()
    evenly = 12.0 / np.maximum(high - low, 1e-9) ** 2
    own = found.model.prior_weight() ** 2
    return np.where(own > 0.0, own, evenly)

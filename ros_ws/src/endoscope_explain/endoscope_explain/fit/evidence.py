"""The evidence for a fitted joint: one number by which everything that may be missing competes.

It is Laplace's approximation of the marginal likelihood (MacKay, Neural Computation 4, 1992), with
the variance of each channel as it is left, but never below the sensor's own. A flexible term pays
for what it could have explained and did not; no penalty is set by hand.
"""

import math

import numpy as np
from scipy.stats import t

from endoscope_explain.explanation import ChannelFit
from endoscope_explain.fit.model import Fit, fit
from endoscope_explain.observe.observation import WHITE, JointObservation
from endoscope_explain.observe.revisits import held_out
from endoscope_explain.recording import Array


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
    """Logarithm of the likelihood of channels with their variance as it is left."""
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


BLOCK = 50
"""Samples of a block whose mean shows slow misfit that single samples hide."""
LIMIT = 5.0
"""Standard deviations of the noise's own scatter that a mean square may exceed."""
NOTABLE = 0.1
"""Share of a wire's samples with more scatter than noise from which on it counts as slipping."""


def excess(fit: Fit) -> dict[str, float]:
    """Return by how many standard deviations each white channel is above noise alone."""
    # The larger of two tests for each signal: of single samples, and of means over blocks. The part
    # of the noise that lasts is one reading a block, so that fewer squares scatter independently
    # (Bayley, Hammersley, J. R. Stat. Soc. Suppl. 8, 1946).
    found = {}
    observation = fit.model.observation
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        if channel.quantity not in WHITE:
            continue
        values = fit.residuals[part]
        count = len(values) // BLOCK
        means = values[: count * BLOCK].reshape(count, BLOCK).mean(axis=1)
        # What lasts has as large a part in a mean as in a reading.
        stays = min(channel.lasting**2 / float(np.mean(channel.noise**2)), 1.0)
        means /= np.sqrt(stays + (1.0 - stays) / BLOCK)
        independent = len(values) / (1.0 + (BLOCK - 1) * stays**2)
        found[channel.signal] = max(_z(values, independent), _z(means, len(means)))
    return found


def is_noise(fit: Fit) -> bool:
    """Return whether no white channel shows more than noise."""
    return all(z < LIMIT for z in excess(fit).values())


def slipping(observation: JointObservation) -> float:
    """Scatter (rms) in N of wires that stick and slip, beside their noise; 0 where few do."""
    wires = [c for c in observation.channels if c.quantity == 'tension']
    scatter = [0.0]
    for noise in (c.noise for c in wires):
        slips = noise > 1.3 * np.min(noise)
        if float(np.mean(slips)) > NOTABLE:
            scatter.append(math.sqrt(np.mean(noise[slips] ** 2) - np.min(noise) ** 2))
    return max(scatter)


def _z(values: np.ndarray, independent: float) -> float:
    return float((np.mean(values**2) - 1.0) / np.sqrt(2.0 / max(independent, 1.0)))


REFIT_STEPS, REFIT_TOLERANCE = 4, 1e-2


def held_out_residuals(final: Fit) -> Array:
    """Residuals (size,) of a fit that has not seen what was held out."""
    fitted, judged = held_out(final.model.observation)
    if judged.all():
        return final.residuals
    weight = fitted * weights(final.model.observation, final.residuals)
    steps = REFIT_STEPS, REFIT_TOLERANCE
    return fit(final.model, final.theta, weight, *steps, final.jacobian).residuals


def held_out_misfit(observation: JointObservation, residuals: Array) -> float:
    """Sum over the signals of the logarithm of their mean square on what was held out."""
    _, judged = held_out(observation)
    return sum(
        float(np.log(np.maximum(np.mean(residuals[part][judged[part]] ** 2), 1.0)))
        for part in observation.slices()
        if judged[part].any()
    )


BATCHES, WORSE = 20, 0.025
"""Parts of what was held out whose means scatter independently (Schmeiser, Oper. Res. 30(3), 1982:
10 to 30 serve), and the chance at which any signal is predicted worse by scatter alone."""


def predicts_worse(observation: JointObservation, before: Array, after: Array) -> bool:
    """Whether residuals (size,) exceed earlier ones in any signal, on what was held out."""
    _, judged = held_out(observation)
    parts = observation.slices()
    least = float(t.ppf(1.0 - WORSE / len(parts), BATCHES - 1))
    for part in parts:
        use = judged[part] if judged[part].any() else np.ones_like(judged[part])
        squares = np.stack([before[part][use] ** 2, after[part][use] ** 2])
        if squares.shape[1] < BATCHES:
            continue
        means = np.array([[np.mean(b) for b in np.array_split(row, BATCHES)] for row in squares])
        # Below its noise no signal is predicted better or worse.
        rise = np.diff(np.maximum(means, 1.0), axis=0)[0]
        scatter = float(np.std(rise, ddof=1)) / math.sqrt(BATCHES)
        # What the noise hides, see `is_noise`, is not worse.
        hidden = LIMIT * math.sqrt(2.0 / squares.shape[1])
        if np.mean(rise) > max(least * scatter, hidden):
            return True
    return False


def held_out_fit(observation: JointObservation, residuals: Array) -> dict[str, ChannelFit]:
    """What residuals (size,) leave of every signal on what was held out."""
    (_, judged), result = held_out(observation), {}
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        use = judged[part] if judged[part].any() else np.ones_like(judged[part])
        noise = channel.noise[use]
        result[channel.signal] = ChannelFit.of(residuals[part][use] * noise, noise)
    return result

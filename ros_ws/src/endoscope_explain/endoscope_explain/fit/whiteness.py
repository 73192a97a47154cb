"""Whether a residual is what the sensors' noise alone leaves."""

import numpy as np

from endoscope_explain.fit.model import Fit
from endoscope_explain.observe.observation import JointObservation

BLOCK = 50
"""Samples of a block whose mean tells slow misfit that single samples hide."""
LIMIT = 5.0
"""Standard deviations of the noise's own scatter that a mean square may exceed."""
NOTABLE = 0.1
"""Share of a wire's samples with more scatter than noise from which on it is said to slip."""
WHITE = frozenset({'tension', 'bending', 'shaft_effort'})
"""Quantities whose noise is white but for rounding; that of the encoder is rounding alone."""


def excess(fit: Fit) -> dict[str, float]:
    """Return by how many standard deviations each white channel is above noise alone.

    The larger of two tests for each signal: of single samples, and of means over blocks. The part
    of the noise that lasts is one reading a block, so that fewer squares scatter independently
    (Bayley, Hammersley, J. R. Stat. Soc. Suppl. 8, 1946).
    """
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


def slips(observation: JointObservation) -> bool:
    """Return whether wires stick and slip in a notable share of a recording."""
    wires = [c for c in observation.channels if c.quantity == 'tension']
    return any(float(np.mean(c.noise > 1.3 * np.min(c.noise))) > NOTABLE for c in wires)


def _z(values: np.ndarray, independent: float) -> float:
    return float((np.mean(values**2) - 1.0) / np.sqrt(2.0 / max(independent, 1.0)))

"""How well a fitted joint explains its channels, in one number that compositions compete by.

The residual of the right effect in another form than the rig's is larger than the noise and
serially correlated. Its size is therefore treated as an unknown scale, never below the noise, and
each channel counts with an effective number of samples (Ljung, System Identification, ch. 16.4).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit

Array = NDArray[np.float64]

EFFECTIVE_SAMPLES = 100.0
"""Independent samples that a channel's correlated misfit is worth over a recording."""
PARAMETER_PRICE = 2.0
"""Score of one more free parameter."""
FLOOR_PER_PARAMETER = PARAMETER_PRICE + 0.5
"""Score of a parameter where only noise is left: its price, and its prior on average."""
NEARLY_NOISE = 100.0
"""Score above noise alone at which an error of form needs no further explanation."""


@dataclass(frozen=True)
class Misfit:
    """Misfit of one joint.

    Attributes
    ----------
    channels : array (C,)
        Mean squared residual of each channel in noise units.
    total : float
        Sum over all samples, in noise units.
    """

    channels: Array
    total: float


def misfit(fit: Fit) -> Misfit:
    """Misfit of a fitted joint, channel by channel."""
    channels = np.array(
        [float(np.mean(fit.residuals[part] ** 2)) for part in fit.model.observation.slices()]
    )
    return Misfit(channels, float(np.sum(fit.residuals**2)))


def score(fit: Fit, weights: Array | None = None) -> float:
    """Penalised half deviance of a fitted joint; smaller is better.

    Parameters
    ----------
    fit : Fit
    weights : array (C,), optional
        Effective samples of each channel.

    Returns
    -------
    float
    """
    size = np.maximum(misfit(fit).channels, 1.0)
    weights = np.full(len(size), EFFECTIVE_SAMPLES) if weights is None else weights
    prior = 0.5 * float(np.sum(fit.model.prior(fit.theta) ** 2))
    return float(0.5 * weights @ np.log(size)) + prior + PARAMETER_PRICE * len(fit.theta)

"""A fit that pays no heed to what a part of the motion shows: a start for what acts there alone.

Where a motor stalls or a joint stands at its stop, a few seconds of large misfit bend all
parameters of a least-squares fit, and the effect that made them no longer promises anything.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit, fit

Array = NDArray[np.float64]

PASSES = 4
STEPS = 6
USUAL = 1.5
"""Multiple of a channel's median misfit beyond which a residual counts for little."""


def robustly_refitted(found: Fit) -> Fit:
    """Fit the larger part of the motion, by iteratively reweighted least squares.

    The weights are those of Geman and McClure, Bulletin of the International Statistical Institute
    52(4), 1987, which let go of outliers altogether; iteration: Holland and Welsch, Communications
    in Statistics A6(9), 1977.

    Parameters
    ----------
    found : Fit
        By least squares; where to start from.

    Returns
    -------
    Fit
        Residuals and cost are those of all samples, each counting once.
    """
    for _ in range(PASSES):
        found = fit(found.model, found.theta, weight=_weights(found), iterations=STEPS)
    return replace(found, cost=found.model.cost(found.residuals, found.theta))


def _weights(found: Fit) -> Array:
    weights = np.empty(len(found.residuals))
    for part in found.model.observation.slices():
        residuals = found.residuals[part]
        usual = max(USUAL * float(np.median(np.abs(residuals))), 1.0)
        weights[part] = 1.0 / (1.0 + (residuals / usual) ** 2)
    return weights

"""Fit one more effect to a joint: a cheap quasi-Newton look first, a full fit where it pays.

The derivative by the parameters that the parent fit already has is shared by all effects that are
tried on it and corrected by Broyden's rank-one update (Broyden, Math. Comp. 19, 1965), so that a
look costs about ten simulations instead of a hundred.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.model import Fit, JointModel, fit, glance, jacobian
from endoscope_explain.onset_scan import redated
from endoscope_explain.screen import Promise, with_effect

Array = NDArray[np.float64]

LOOK_STEPS = 5


@dataclass(frozen=True)
class Look:
    """A candidate after the cheap fit.

    Attributes
    ----------
    effects : tuple of str
        Effects on the joint, the new one last.
    model : JointModel
    theta : array (n,)
    cost : float
    """

    effects: tuple[str, ...]
    model: JointModel
    theta: Array
    cost: float


def look(
    anchors: tuple[Fit, ...], effects: tuple[str, ...], promise: Promise, steps: int = LOOK_STEPS
) -> Look:
    """Cheap fit of one more effect from one starting point.

    Parameters
    ----------
    anchors : tuple of Fit
        Fits of the same model without the effect, to start from; the better one is taken.
    effects : tuple of str
        Effects that the anchors already have.
    promise : Promise
        Effect and starting point.
    steps : int
        Quasi-Newton steps.

    Returns
    -------
    Look
    """
    model = with_effect(anchors[0].model, promise.effect_id, promise.start)
    begun = []
    for anchor in anchors:
        theta = model.begun_at(anchor.theta)
        begun.append((theta, model.residuals(theta), anchor))
    theta, residuals, anchor = min(
        begun, key=lambda b: float(np.sum(b[1] ** 2) + np.sum(model.prior(b[0]) ** 2))
    )
    columns = list(range(len(anchor.theta), len(theta)))
    derivative = np.hstack([anchor.jacobian, jacobian(model, theta, residuals, columns)])
    found = glance(model, theta, derivative, steps)
    return Look((*effects, promise.effect_id), model, found.theta, found.cost)


def polish(candidate: Look, iterations: int = 10) -> Fit:
    """Full fit of a candidate from where its look ended."""
    return redated(fit(candidate.model, candidate.theta, iterations=iterations))

"""Prandtl-Ishlinskii hysteresis, a weighted sum of plays, as a black-box baseline."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from endoscope_core.identification import HysteresisRecording

Array = NDArray[np.float64]

ELEMENTS = 20
_WEIGHTS = (1.0 / 40.0, 3.0)
"""Least weight of the first play, which passes its input, and greatest of any."""


def fitted(recording: HysteresisRecording, driver: Array) -> Array:
    """Actual angle (N,) in rad for a driving angle, by a model fitted to a recording from rest.

    ``theta_a = offset + sum_i w_i p_i`` with `p_i` the play of threshold `r_i` (Krejci and Kuhnen
    2001); weights that are not negative make it monotone.
    """
    reach = float(np.max(np.abs(recording.driver)))
    thresholds = reach * np.arange(ELEMENTS) / ELEMENTS
    known = _plays(thresholds, recording.driver)
    low = np.zeros(ELEMENTS)
    low[0] = _WEIGHTS[0]
    high = np.full(ELEMENTS, _WEIGHTS[1])
    weights = lsq_linear(
        recording.centred(known), recording.centred(recording.actual), (low, high)
    ).x
    offset = np.mean(recording.actual - known @ weights)
    found: Array = offset + _plays(thresholds, driver) @ weights
    return found


def _plays(thresholds: Array, driver: Array) -> Array:
    """Outputs (N, M) of plays of M thresholds along a driving angle (N,), from rest."""
    states = np.empty((driver.size, thresholds.size))
    state = np.zeros(thresholds.size)
    for k, angle in enumerate(driver.tolist()):
        state = np.minimum(angle + thresholds, np.maximum(angle - thresholds, state))
        states[k] = state
    return states

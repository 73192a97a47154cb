"""Intervals of fitted numbers that allow for serially correlated errors of form.

The covariance is the sandwich estimate: the curvature of the cost on both sides of the scatter of
its gradient, summed over blocks longer than the misfit's memory (White, Econometrica 50, 1982;
Newey and West, Econometrica 55, 1987). Where nothing but noise is left, it is the Fisher
information's; an error of form widens it by what it does to the gradient.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.effect import Effect
from endoscope_explain.explanation import Estimate, NominalEstimate
from endoscope_explain.fit.free_parameters import BAND, FITTED_NOMINAL, FORM_SPREAD
from endoscope_explain.fit.model import Fit
from endoscope_explain.fit.whiteness import is_noise

Array = NDArray[np.float64]

BLOCK_S = 1.0
NINETY_PERCENT = 1.645
WIDENING = 1.2
"""Calibrated on concealed cases: what the sandwich misses when the form differs."""
FORM = 0.0012
"""Relative error of a parameter by form alone, where nothing but noise is left."""
FORM_SEEN = 0.0072
"""The same where an error of form is seen."""


@dataclass(frozen=True)
class Intervals:
    """90 % intervals of a fit's free parameters.

    Attributes
    ----------
    names : tuple of str
    indices : tuple of int
        Places in the packed parameters.
    values, low, high : array (n,)
    """

    names: tuple[str, ...]
    indices: tuple[int, ...]
    values: Array
    low: Array
    high: Array


def covariance(fit: Fit) -> Array:
    """Sandwich covariance (n, n) of the coordinates of a fit."""
    prior = np.diag(fit.model.prior_weight() ** 2)
    ridge = 1e-9 * np.diag(np.maximum(np.sum(fit.jacobian**2, axis=0), 1e-12))
    curvature = np.linalg.inv(fit.jacobian.T @ fit.jacobian + prior + ridge)
    middle = prior.copy()
    observation = fit.model.observation
    gradients = fit.jacobian * fit.residuals[:, None]
    blocks = np.concatenate(
        [np.floor(channel.time / BLOCK_S).astype(int) for channel in observation.channels]
    )
    sums = np.zeros((int(blocks.max()) + 1, fit.jacobian.shape[1]))
    np.add.at(sums, blocks, gradients)
    middle += sums.T @ sums
    sandwich = curvature @ middle @ curvature
    # Quantised channels scatter less than white noise; nothing is known better than it allows.
    return np.asarray(
        np.where(np.eye(len(sandwich)) > 0, np.maximum(sandwich, curvature), sandwich)
    )


def intervals(fit: Fit) -> Intervals:
    """90 % intervals of a fit, within the parameters' bounds."""
    free = fit.model.free
    share = FORM if is_noise(fit) else FORM_SEEN
    form = np.array(
        [
            share * (1.0 if item.logarithmic else abs(t))
            for item, t in zip(free, fit.theta, strict=True)
        ]
    )
    reach = np.hypot(
        NINETY_PERCENT * WIDENING * np.sqrt(np.diag(covariance(fit))), NINETY_PERCENT * form
    )
    return Intervals(
        tuple(item.name for item in free),
        tuple(item.index for item in free),
        np.array([item.value(t) for item, t in zip(free, fit.theta, strict=True)]),
        np.array([item.value(t) for item, t in zip(free, fit.theta - reach, strict=True)]),
        np.array([item.value(t) for item, t in zip(free, fit.theta + reach, strict=True)]),
    )


def may_be_absent(fit: Fit, effect: Effect) -> bool:
    """Whether the intervals of all strengths of an effect hold the value at which it vanishes."""
    off = {
        index: parameter.off
        for index, parameter in zip(effect.places, effect.parameters, strict=True)
        if math.isfinite(parameter.off)
    }
    strengths = [k for k, item in enumerate(fit.model.free) if item.index in off]
    if not strengths:
        return False
    found = intervals(fit)
    return all(found.low[k] <= off[found.indices[k]] <= found.high[k] for k in strengths)


def nominal_estimates(
    fit: Fit, described: Array, units: dict[str, str]
) -> dict[str, NominalEstimate]:
    """Estimates of the nominal parameters of a fit, beside those described (parameters,)."""
    found = intervals(fit)
    return {
        name: NominalEstimate(
            float(value),
            float(low),
            float(high),
            units.get(name, ''),
            float(described[index]),
            _in_band(name, float(value), float(described[index])),
        )
        for name, index, value, low, high in zip(
            found.names, found.indices, found.values, found.low, found.high, strict=True
        )
        if name in FITTED_NOMINAL
    }


def _in_band(name: str, value: float, described: float) -> bool:
    if name in FORM_SPREAD:
        return abs(value - described) <= NINETY_PERCENT * FORM_SPREAD[name]
    return bool(abs(np.log(value / described)) <= np.log1p(BAND))


def effect_estimates(fit: Fit, first: int, units: dict[str, str]) -> dict[str, Estimate]:
    """Estimates of one effect's parameters: those named in `units`, from packed index `first`."""
    found = intervals(fit)
    packed, _ = fit.model.packed(fit.theta)
    estimates = {}
    for offset, (name, unit) in enumerate(units.items()):
        index = first + offset
        if index in found.indices:
            i = found.indices.index(index)
            estimates[name] = Estimate(
                float(found.values[i]), float(found.low[i]), float(found.high[i]), unit
            )
        else:
            value = float(packed[index])
            estimates[name] = Estimate(value, value, value, unit)
    return estimates

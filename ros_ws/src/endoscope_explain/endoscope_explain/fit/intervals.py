"""Intervals of fitted numbers: what noise and an error of form leave open.

Noise alone makes intervals that hold a third of the true values where the form differs. By how much
rigs of another form move the numbers is added to it, see `other_forms`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import lacking
from endoscope_explain.criteria import REACH
from endoscope_explain.explanation import Estimate, NominalEstimate
from endoscope_explain.fit.evidence import weights
from endoscope_explain.fit.free_parameters import (
    COEFFICIENT,
    FITTED_NOMINAL,
    NINETY_PERCENT,
    tolerance,
)
from endoscope_explain.fit.model import Fit

Array = NDArray[np.float64]

DEGREES = 19
"""Of freedom of what moves the numbers: rigs of another form that were fitted."""
SHOWN = math.sqrt(0.5)
"""Deviation over the prior's up to which a recording says as much of a number as the prior does:
their precisions add."""
TOGETHER = math.sqrt(0.75)
"""Correlation from which on one number, were it known, would halve the other one's deviation."""


@dataclass(frozen=True)
class Intervals:
    """90 % intervals of a fit's free parameters.

    Shapes: `values`, `low`, `high` (n,).
    `indices`: places in the packed parameters.
    `shown` (n,): whether the recording says more of it than the prior.
    `partners`: number without which the recording does not tell this one; empty where it does.
    """

    names: tuple[str, ...]
    indices: tuple[int, ...]
    values: Array
    low: Array
    high: Array
    shown: NDArray[np.bool_]
    partners: tuple[str, ...]


def covariance(fit: Fit) -> Array:
    """Covariance (n, n) of the coordinates of a fit by what is left as white noise."""
    weighted = fit.jacobian * weights(fit.model.observation, fit.residuals)[:, None]
    precision = weighted.T @ weighted + np.diag(fit.model.prior_weight() ** 2)
    ridge = 1e-9 * np.diag(np.maximum(np.diag(precision), 1e-12))
    return np.asarray(np.linalg.inv(precision + ridge))


def _with_form(spread: Array, fit: Fit) -> Array:
    """A fit's covariance (n, n) and what another form moves, as few rigs tell (Student's t)."""
    if fit.moved_by_form is None:
        return spread
    scale = t.ppf(0.95, DEGREES) / NINETY_PERCENT
    return np.asarray(spread + scale**2 * fit.moved_by_form)


def intervals(fit: Fit) -> Intervals:
    """90 % intervals of a fit, within the parameters' bounds."""
    kept = [k for k, item in enumerate(fit.model.free) if item.index != COEFFICIENT]
    free = [fit.model.free[k] for k in kept]
    theta = fit.theta[kept]
    whole = covariance(fit)
    spread = whole[np.ix_(kept, kept)]
    deviation = np.sqrt(np.diag(spread))
    correlation = np.abs(spread) / np.outer(deviation, deviation) - np.eye(len(kept))
    reach = NINETY_PERCENT * np.sqrt(np.diag(_with_form(whole, fit))[kept])
    prior = np.array([item.spread for item in free])
    shown = reach <= SHOWN * NINETY_PERCENT * prior
    # Of two that go together the prior of one may have narrowed the other.
    bound = (correlation > TOGETHER) & ~np.logical_and.outer(shown, shown)
    nearest = np.where(bound, correlation, 0.0).argmax(axis=1)
    partners = (free[n].name if bound[k, n] else '' for k, n in enumerate(nearest))
    reach *= REACH

    def values(coordinates: Array) -> Array:
        return np.array([item.value(c) for item, c in zip(free, coordinates, strict=True)])

    return Intervals(
        tuple(item.name for item in free),
        tuple(item.index for item in free),
        values(theta),
        values(theta - reach),
        values(theta + reach),
        shown,
        tuple(partners),
    )


def may_be_absent(fit: Fit, effect: Effect) -> bool:
    """Whether the region that holds all strengths of an effect holds none of it (Wald's test).

    Strengths that stand for one another may each be nothing, but not all at once: their 90 % region
    is an ellipsoid, for one strength its interval.
    """
    off = {
        index: parameter.off
        for index, parameter in zip(effect.places, effect.parameters, strict=True)
        if math.isfinite(parameter.off)
    }
    free = fit.model.free
    strengths = [k for k, item in enumerate(free) if item.index in off]
    if not strengths:
        return False
    spread = _with_form(covariance(fit), fit)[np.ix_(strengths, strengths)]
    distance = np.array([fit.theta[k] - free[k].coordinate(off[free[k].index]) for k in strengths])
    squared = float(distance @ np.linalg.solve(spread, distance)) / REACH**2
    return squared <= chi2.ppf(0.9, len(strengths))


def nominal_estimates(
    fit: Fit, described: Array, units: dict[str, str]
) -> dict[str, NominalEstimate]:
    """Estimates of the nominal parameters of a fit, beside those described (parameters,)."""
    found = intervals(fit)
    absent = {place for each in lacking(described) for place in each.places}
    return {
        name: NominalEstimate(
            float(value),
            float(low),
            float(high),
            units.get(name, ''),
            float(described[index]),
            _in_band(name, float(value), float(described[index])),
            bool(shown),
            partner,
        )
        for name, index, value, low, high, shown, partner in zip(
            found.names,
            found.indices,
            found.values,
            found.low,
            found.high,
            found.shown,
            found.partners,
            strict=True,
        )
        if name in FITTED_NOMINAL and index not in absent
    }


def _in_band(name: str, value: float, described: float) -> bool:
    low, high = tolerance(name, described)
    return low <= value <= high


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

"""Intervals of fitted numbers: what noise and an error of form leave open.

Noise alone makes intervals that hold a third of the true values where the form differs. By how much
rigs of another form move the numbers is added to it, see `other_forms`.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2, t

from endoscope_core.physics.description import NUMBERS
from endoscope_core.physics.effect import Effect
from endoscope_core.physics.effects import lacking
from endoscope_core.physics.functions.places import NODES, VALUES
from endoscope_core.physics.layout import FRICTION_PROFILE, NOMINAL_KEYS, PROFILE_TERMS
from endoscope_core.workers import parallel_map
from endoscope_explain.criteria import INTERVAL_WIDTH
from endoscope_explain.explanation import NINETY_PERCENT, Estimate, NominalEstimate
from endoscope_explain.fit.evidence import counts, is_noise, mean_squares, weights
from endoscope_explain.fit.free_parameters import (
    COEFFICIENT,
    FITTED_NOMINAL,
    FRICTION_PROFILE_NAMES,
    nominal_number,
    tolerance,
)
from endoscope_explain.fit.model import Fit, broyden_fit
from endoscope_explain.observe.observation import JointObservation
from endoscope_explain.recording import Array

# A fit's misfit is mostly an error of form, not noise: friction along a real sheath has a finer
# profile than the few terms that are fitted, and a law has finer details than the function that
# was found for it. Rigs are simulated at the fitted numbers with a profile drawn beyond those terms
# and functions with details, and the model is fitted to each of them. What that leaves, and by how
# much it moves the numbers, is what form alone does (a parametric bootstrap over forms: Efron,
# Tibshirani, An Introduction to the Bootstrap, 1993, ch. 21).


STEPS = 8
"""Simulations in which the model is fitted to a rig of another form, whose numbers are its own."""
FORMS = 19
"""Rigs that show what another form leaves, and how far it moves numbers: 1 in 20 leaves more."""
_SEED = 7
_TINY = 1e-12


def other_forms(found: Fit, count: int, jobs: int) -> tuple[Array, Array]:
    """What fits to noise-free rigs of another form leave (size, B), and move coordinates (n, B)."""
    model = found.model.on_coarse_ticks()
    parameters, lead = model.packed(found.theta)
    # The fitted numbers are these rigs' own: there is nothing that would draw a fit elsewhere.
    free = tuple(
        replace(item, mean=float(t)) for item, t in zip(model.free, found.theta, strict=True)
    )
    weight = weights(model.observation, found.residuals)
    finer = slice(FRICTION_PROFILE + len(FRICTION_PROFILE_NAMES), FRICTION_PROFILE + PROFILE_TERMS)
    size = NUMBERS['friction_profile'].spread
    generator = np.random.default_rng(_SEED)

    def drawn() -> Array:
        rig = parameters.copy()
        rig[finer] += size * generator.normal(size=finer.stop - finer.start)
        for family in model.families:
            first = family.place.first_parameter + VALUES
            detailed = rig[first : first + NODES] + family.details(generator)
            rig[first : first + NODES] = family.within(detailed)
        return rig

    def fitted(rig: Array) -> tuple[Array, Array]:
        readings = reading(model.observation, model.residuals_of(rig, lead))
        seen = replace(model, observation=readings, free=free)
        near = broyden_fit(seen, found.theta, found.jacobian, STEPS, weight)
        return near.residuals, near.theta - found.theta

    results = parallel_map(fitted, [drawn() for _ in range(count)], jobs)
    residuals, moved = zip(*results, strict=True)
    return np.stack(residuals, axis=1), np.stack(moved, axis=1)


def with_form(found: Fit, jobs: int) -> Fit:
    """A fit with `moved_by_form` and `beyond_form`: what an error of form does to it."""
    if found.beyond_form is not None:
        return found
    if is_noise(found):
        return replace(found, beyond_form=0.0)
    of_forms, moved = other_forms(found, FORMS, jobs)
    observation = found.model.observation
    left = np.maximum(mean_squares(observation, found.residuals) - 1.0, 0.0)
    drawn = np.stack([mean_squares(observation, r) for r in of_forms.T])
    beyond = float(np.max(np.sqrt((1.0 + left) / (1.0 + drawn.max(axis=0)))))
    # An error of form moves numbers the further the more of it there is.
    size = counts(observation) / (1.0 + left)
    scale = np.sum(size * left) / max(float(np.sum(size * drawn.mean(axis=0))), _TINY)
    return replace(found, moved_by_form=scale * moved @ moved.T / FORMS, beyond_form=beyond)


def reading(observation: JointObservation, residuals: Array) -> JointObservation:
    """Sensors as they would read if they read more by residuals (size,) in noise units."""
    channels = tuple(
        replace(c, value=c.value + residuals[part] * c.noise)
        for c, part in zip(observation.channels, observation.slices(), strict=True)
    )
    return replace(observation, channels=channels)


SHOWN = math.sqrt(0.5)
"""Deviation over the prior's up to which a recording shows as much of a number as the prior does:
their precisions add."""
TOGETHER = math.sqrt(0.75)
"""Correlation from which on one number, were it known, would halve the other one's deviation."""


@dataclass(frozen=True)
class Interval:
    """90 % interval of a free parameter of a fit."""

    name: str
    index: int  # place in the packed parameters
    value: float
    low: float
    high: float
    shown: bool  # whether the recording shows more of it than the prior
    partner: str  # number without which the recording does not show this one; empty where it does


def covariance(fit: Fit) -> Array:
    """Covariance (n, n) of the coordinates of a fit by what is left as white noise."""
    weighted = fit.jacobian * weights(fit.model.observation, fit.residuals)[:, None]
    precision = weighted.T @ weighted + np.diag(fit.model.prior_weight() ** 2)
    ridge = 1e-9 * np.diag(np.maximum(np.diag(precision), 1e-12))
    return np.asarray(np.linalg.inv(precision + ridge))


def _with_form(spread: Array, fit: Fit) -> Array:
    """A fit's covariance (n, n) and what another form moves, as few rigs show (Student's t)."""
    if fit.moved_by_form is None:
        return spread
    scale = t.ppf(0.95, FORMS) / NINETY_PERCENT
    return np.asarray(spread + scale**2 * fit.moved_by_form)


def intervals(fit: Fit) -> list[Interval]:
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
    reach *= INTERVAL_WIDTH
    numbers = zip(free, theta.tolist(), reach.tolist(), shown.tolist(), partners, strict=True)
    return [
        Interval(
            item.name,
            item.index,
            float(item.value(at)),
            float(item.value(at - by)),
            float(item.value(at + by)),
            seen,
            partner,
        )
        for item, at, by, seen, partner in numbers
    ]


def may_be_absent(fit: Fit, effect: Effect) -> bool:
    """Whether the region that holds all strengths of an effect holds none of it (Wald's test)."""
    # Strengths that stand for one another may each be nothing, but not all at once: their 90 %
    # region is an ellipsoid, for one strength its interval.
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
    squared = float(distance @ np.linalg.solve(spread, distance)) / INTERVAL_WIDTH**2
    return squared <= chi2.ppf(0.9, len(strengths))


NOMINAL_UNITS = {
    name: nominal_number(name).unit or '-' for name in (*NOMINAL_KEYS, *FRICTION_PROFILE_NAMES)
}


def nominal_estimates(fit: Fit, described: Array) -> dict[str, NominalEstimate]:
    """Estimates of the nominal parameters of a fit, beside those described (parameters,)."""
    ends, estimates = fit.at_bounds(), {}
    absent = {place for each in lacking(described) for place in each.places}
    for each in intervals(fit):
        if each.name in FITTED_NOMINAL and each.index not in absent:
            nominal = float(described[each.index])
            low, high = tolerance(each.name, nominal)
            estimates[each.name] = NominalEstimate(
                each.value,
                each.low,
                each.high,
                NOMINAL_UNITS[each.name],
                nominal,
                low <= each.value <= high,
                each.shown,
                each.partner,
                each.name in ends,
            )
    return estimates


def effect_estimates(fit: Fit, effect: Effect) -> dict[str, Estimate]:
    """Estimates of one effect's parameters, by their names."""
    found = {each.index: each for each in intervals(fit)}
    packed, _ = fit.model.packed(fit.theta)
    estimates = {}
    for index, parameter in zip(effect.places, effect.parameters, strict=True):
        value = low = high = float(packed[index])
        if (each := found.get(index)) is not None:
            value, low, high = each.value, each.low, each.high
        estimates[parameter.name] = Estimate(value, low, high, parameter.unit)
    return estimates

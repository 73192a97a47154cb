"""Fit a joint with one term more.

The derivative by the numbers that the fit without it has is shared by all terms that are tried and
corrected by Broyden's rank-one update (Broyden, Math. Comp. 19, 1965), so that a first look costs
about ten simulations instead of a hundred.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.fit.evidence import log_evidence, weights
from endoscope_explain.fit.free_parameters import COORDINATE
from endoscope_explain.fit.model import Fit, JointModel, fit, glance, jacobian
from endoscope_explain.fit.valleys import out_of_valleys
from endoscope_explain.search.candidate import Candidate

Array = NDArray[np.float64]

FINER = ((14, 0.125), (21, 0.08))
"""Coefficients of finer functions, and lengths over which they vary, as shares of the range."""
LOOK_STEPS = 6
FINE_STEPS = 4
ITERATIONS, ROUGH, SETTLED = 25, 1e-2, 1e-4
"""Steps of a fit, at most, and the shares of the cost below which it tells and below which it
stands."""


@dataclass(frozen=True)
class Composition:
    """A fitted joint with some terms.

    Attributes
    ----------
    terms : tuple of Candidate
        In the order in which they were added.
    fit : Fit
    evidence : float
        See `log_evidence`.
    """

    terms: tuple[Candidate, ...]
    fit: Fit
    evidence: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of those that are effects of the catalogue."""
        return tuple(term.id for term in self.terms if not term.is_function)


def composition(terms: tuple[Candidate, ...], found: Fit) -> Composition:
    """A fit with its evidence."""
    return Composition(terms, found, log_evidence(found))


@dataclass(frozen=True)
class Look:
    """A term after a first fit of few simulations.

    Attributes
    ----------
    candidate : Candidate
    model : JointModel
    theta : array (n,)
    cost : float
        Half the squares, weighted by what the fit without it is off by.
    """

    candidate: Candidate
    model: JointModel
    theta: Array
    cost: float


def look(anchors: tuple[Fit, ...], candidate: Candidate) -> Look:
    """First fit of one term more.

    Parameters
    ----------
    anchors : tuple of Fit
        Fits of the same model without the term, to start from: what was missing has bent the
        numbers of the first one, and the description may be nearer. The better one is taken.
    candidate : Candidate

    Returns
    -------
    Look
    """
    fine = candidate.added_to(anchors[0].model)
    model = fine.on_coarse_ticks()
    weight = weights(model.observation, anchors[0].residuals)
    best: Look | None = None
    for anchor in anchors:
        theta = model.begun_at(anchor.theta)
        new = list(range(len(anchor.theta), len(theta)))
        derivative = np.hstack([anchor.jacobian, jacobian(model, theta, new)])
        found = glance(model, theta, derivative, LOOK_STEPS, weight)
        if best is None or found.cost < best.cost:
            best = Look(candidate, fine, found.theta, found.cost)
    assert best is not None
    return best


def polish(seen: Look, without: Fit) -> Fit:
    """Fit of a term from where its first look ended, as far as tells which term is the best.

    Parameters
    ----------
    seen : Look
    without : Fit
        By what this is off, channels are weighted at first; then by what is left.

    Returns
    -------
    Fit
    """
    weight = weights(seen.model.observation, without.residuals)
    found = fit(seen.model, seen.theta, weight, ITERATIONS, ROUGH)
    weight = weights(seen.model.observation, found.residuals)
    found = fit(found.model, found.theta, weight, ITERATIONS, ROUGH, found.jacobian)
    return out_of_valleys(found, weight)


def settled(found: Fit, weight: Array) -> Fit:
    """Go on with a fit until nothing moves any more."""
    return fit(found.model, found.theta, weight, ITERATIONS, SETTLED, found.jacobian)


def until_it_stands(one: Composition) -> Composition:
    """A composition fitted on until nothing moves any more."""
    weight = weights(one.fit.model.observation, one.fit.residuals)
    again = composition(one.terms, settled(one.fit, weight))
    return again if again.evidence > one.evidence else one


def exactly_settled(one: Composition) -> Composition:
    """A composition fitted on by derivatives on fine ticks, where coarse ones may mislead."""
    model = replace(one.fit.model, coarse=1)
    found = fit(model, one.fit.theta, weights(model.observation, one.fit.residuals), FINE_STEPS)
    again = composition(one.terms, replace(found, model=one.fit.model))
    return again if again.evidence > one.evidence else one


def refined(one: Composition, without: Fit) -> Composition:
    """A composition whose last function is as fine as the evidence is for.

    Parameters
    ----------
    one : Composition
        Its last term is a function.
    without : Fit
        The fit without that function.

    Returns
    -------
    Composition
    """
    best, term = one, one.terms[-1]
    assert term.family is not None
    values = fitted_values(one.fit)
    for count, length in FINER:
        finer = replace(term, family=term.family.finer(count, length))
        model = finer.added_to(without.model)
        theta = model.begun_at(one.fit.theta[: len(without.theta)])
        assert finer.family is not None
        near, *_ = np.linalg.lstsq(finer.family.basis, values, rcond=None)
        theta[model.places_of_coefficients()[-1]] = near / COORDINATE
        low, high = model.bounds()
        weight = weights(model.observation, one.fit.residuals)
        found = fit(model, np.clip(theta, low, high), weight, ITERATIONS)
        weight = weights(model.observation, found.residuals)
        again = composition((*one.terms[:-1], finer), settled(found, weight))
        if again.evidence <= best.evidence:
            break
        best = again
    return best


def fitted_values(found: Fit) -> Array:
    """The last function of a fit at its nodes (NODES,)."""
    return found.model.families[-1].values(found.model.coefficients(found.theta)[-1])

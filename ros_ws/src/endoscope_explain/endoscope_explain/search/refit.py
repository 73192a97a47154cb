"""Fit a joint with one term more, in one recording or in several of the same rig together.

The derivative by the numbers that the fit without it has is shared by all terms that are tried and
corrected by Broyden's rank-one update (Broyden, Math. Comp. 19, 1965), so that a trial fit costs
about ten simulations instead of a hundred.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from endoscope_core.physics.functions.places import NODES
from endoscope_explain.fit.evidence import (
    held_out_misfit,
    held_out_residuals,
    is_noise,
    log_evidence,
    weights,
)
from endoscope_explain.fit.family import COEFFICIENTS, visited_range
from endoscope_explain.fit.free_parameters import COORDINATE
from endoscope_explain.fit.model import Fit, JointModel, broyden_fit, fit, jacobian
from endoscope_explain.fit.pooled import fit_together, with_common_numbers
from endoscope_explain.fit.valleys import out_of_valleys
from endoscope_explain.recording import Array
from endoscope_explain.search.left_out import likelihoods
from endoscope_explain.search.term import Term, states_of

FINER = (2 * COEFFICIENTS, 4 * COEFFICIENTS, NODES)
"""Coefficients of finer functions: twice as many each time, up to a value for every node."""
TRIAL_STEPS = 6
FINE = 2
"""Ticks in one of these simulations: on nine levels of six development cases, derivatives by single
ticks gained 4 nats more of 299 and else 2 at most, at twice the cost."""
ITERATIONS, ROUGH, SETTLED = 25, 1e-2, 1e-4
"""Steps of a fit, at most, and the shares of the cost below which it decides and below which it
stands."""


@dataclass(frozen=True)
class Candidate:
    """A fitted joint with some terms, in one recording or in several of the same rig."""

    terms: tuple[Term, ...]  # in the order in which they were added
    # One of each recording; of several, one that has no use for a term lacks it.
    fits: tuple[Fit, ...]
    evidence: float  # of all recordings; see `log_evidence`

    @property
    def fit(self) -> Fit:
        """The fit of the only recording."""
        (only,) = self.fits
        return only

    @property
    def is_noise(self) -> bool:
        """Whether nothing is left to explain in any recording."""
        return all(is_noise(each) for each in self.fits)

    @cached_property
    def unseen(self) -> tuple[Array, ...]:
        """Residuals (size,) of refits that have not seen what was held out."""
        return tuple(held_out_residuals(each) for each in self.fits)

    @cached_property
    def unseen_misfit(self) -> float:
        """What these refits leave of it; see `held_out_misfit`."""
        return sum(
            held_out_misfit(each.model.observation, left)
            for each, left in zip(self.fits, self.unseen, strict=True)
        )

    @cached_property
    def foretold(self) -> Array:
        """Logarithm (n,) of the likelihood of each recording by the others, of several."""
        return likelihoods(self.fits)

    @property
    def effects(self) -> tuple[str, ...]:
        """Ids of those that are effects of the catalogue."""
        return tuple(term.id for term in self.terms if not term.is_function)

    @property
    def adds_nominal(self) -> bool:
        """Whether the last term is a piece of the nominal physics, which every rig has."""
        return bool(self.terms) and self.terms[-1].is_in_every_rig


def candidate(terms: tuple[Term, ...], *fits: Fit) -> Candidate:
    """Fits with their evidence."""
    return Candidate(terms, fits, sum(log_evidence(each) for each in fits))


@dataclass(frozen=True)
class TrialFit:
    """A term after a first fit of few simulations on coarse ticks."""

    term: Term
    model: JointModel  # on fine ticks
    coarse: JointModel  # the same on coarse ones
    theta: Array  # (n,)
    cost: float  # half the squares, weighted by what the fit without it is off by


def trial_fit(references: tuple[Fit, ...], term: Term, offset: Array) -> TrialFit:
    """First fit of one term more, from the better one of several fits without it."""
    # What was missing has bent the numbers of the first one, and the description may be nearer. The
    # offset (size,) is what coarse ticks do to the residuals of the first of them.
    model = term.added_to(references[0].model)
    coarse = model.on_coarse_ticks(offset)
    weight = weights(model.observation, references[0].residuals)

    def begun_from(reference: Fit) -> TrialFit:
        theta = model.begun_at(reference.theta)
        new = list(range(len(reference.theta), len(theta)))
        derivative = np.hstack([reference.jacobian, jacobian(coarse, theta, new)])
        found = broyden_fit(coarse, theta, derivative, TRIAL_STEPS, weight)
        return TrialFit(term, model, coarse, found.theta, found.cost)

    return min(map(begun_from, references), key=lambda each: each.cost)


def cost_before(found: Fit) -> float:
    """Half the squares of a fit, weighted as those of a trial fit beside it are."""
    weight = weights(found.model.observation, found.residuals)
    return found.model.cost(weight * found.residuals, found.theta)


def begun_beside(function: Fit, without: Fit, starts: Sequence[Term], offset: Array) -> TrialFit:
    """The start of a formula that leaves least beside the numbers of a fit with its function."""
    weight = weights(function.model.observation, without.residuals)

    def begun(term: Term) -> TrialFit:
        model = term.added_to(without.model)
        coarse = model.on_coarse_ticks(offset)
        theta = model.begun_at(function.theta[: len(without.theta)])
        cost = coarse.cost(weight * coarse.residuals(theta), theta)
        return TrialFit(term, model, coarse, theta, cost)

    return min(map(begun, starts), key=lambda each: each.cost)


def term_of(seen: Sequence[TrialFit | None]) -> Term:
    """The term that trial fits of all recordings share, as it begins in the first of them."""
    return next(each.term for each in seen if each is not None)


def refit(seen: Sequence[TrialFit | None], without: Candidate) -> Candidate:
    """Fit of a term from its trial fits, as far as shows which term is the best."""
    # A recording that has no use for the term, None, stays without it.
    fits = [
        own if each is None else _refit(each, own)
        for each, own in zip(seen, without.fits, strict=True)
    ]
    if len(fits) > 1:
        fits = fit_together([f.model for f in fits], [f.theta for f in fits], rough=True)
    return candidate((*without.terms, term_of(seen)), *fits)


def _refit(seen: TrialFit, without: Fit) -> Fit:
    """Fit of a term to one recording on coarse ticks."""
    # By what the fit without it is off, channels are weighted at first; then by what is left.
    weight = weights(seen.model.observation, without.residuals)
    found = _twice(seen.model, seen.coarse.offset, seen.theta, weight)
    found = out_of_valleys(found, weights(seen.model.observation, found.residuals))
    return _on_fine_ticks(found, seen.model)


def refined(one: Candidate, without: Fit, offset: Array) -> Candidate:
    """A candidate whose last term, a function, is as fine as the evidence allows."""
    best, term = one, one.terms[-1]
    for count in FINER:
        assert term.family is not None
        before = best.fit.model.family_at(-1, best.fit.theta)
        # With what was missing, the joint goes further than it did without.
        visited = before.low, before.high
        if not before.repeats:
            tick = best.fit.model.observation.tick
            visited = visited_range(before.place, states_of(best.fit), tick, before.lag)
        finer = replace(term, family=before.finer(count, visited))
        assert finer.family is not None
        model = finer.added_to(without.model)
        values = before.values(best.fit.model.coefficients(best.fit.theta)[-1])
        values = np.interp(finer.family.nodes, before.nodes, values)
        near, *_ = np.linalg.lstsq(finer.family.basis, values, rcond=None)
        theta = model.begun_at(best.fit.theta[: len(without.theta)])
        theta[model.places_of_coefficients()[-1]] = near / COORDINATE
        low, high = model.bounds()
        weight = weights(model.observation, best.fit.residuals)
        found = _twice(model, offset, np.clip(theta, low, high), weight)
        again = candidate((*one.terms[:-1], finer), _on_fine_ticks(found, model))
        if again.evidence <= best.evidence:
            break
        best = again
        if found.model.offset is not None:
            offset = found.model.offset
    return best


def _twice(model: JointModel, offset: Array | None, theta: Array, weight: Array) -> Fit:
    """Fit on coarse ticks with weights as given, then by what that leaves on fine ones."""
    # What coarse ticks do to the residuals is known for `theta` at first, then for the first fit.
    found = fit(model.on_coarse_ticks(offset), theta, weight, ITERATIONS, ROUGH)
    fine = model.residuals(found.theta)
    again = model.on_coarse_ticks(fine - model.on_coarse_ticks().residuals(found.theta))
    weight = weights(model.observation, fine)
    return fit(again, found.theta, weight, ITERATIONS, ROUGH, found.jacobian)


def _on_fine_ticks(found: Fit, model: JointModel) -> Fit:
    """A fit of a model on coarse ticks with the residuals that it leaves on fine ones."""
    model = replace(model, base=found.model.base)
    return replace(found, model=model, residuals=model.residuals(found.theta))


def converged(one: Candidate) -> Candidate:
    """A candidate fitted on fine ticks until nothing moves any more."""
    if len(one.fits) > 1:
        return _converged_together(one)
    weight = weights(one.fit.model.observation, one.fit.residuals)
    found = fit(one.fit.model, one.fit.theta, weight, ITERATIONS, SETTLED, one.fit.jacobian)
    return candidate(one.terms, found)


def _converged_together(one: Candidate) -> Candidate:
    # A fit by itself may lie in another valley than those of the same rig in other shapes: it is
    # begun as well where all recordings are alike.
    models = [each.model for each in one.fits]
    starts = [each.theta for each in one.fits], with_common_numbers(one.fits)
    found = [candidate(one.terms, *fit_together(models, start)) for start in starts]
    return max(found, key=lambda each: each.evidence)


def by_fine_derivatives(one: Candidate) -> Candidate:
    """A candidate fitted on by derivatives on finer ticks, where coarse ones may mislead."""
    if len(one.fits) > 1:
        return one  # fitted together by such derivatives
    model = replace(one.fit.model, coarse=FINE)
    weight = weights(model.observation, one.fit.residuals)
    found = fit(model, one.fit.theta, weight, tolerance=SETTLED)
    again = candidate(one.terms, replace(found, model=one.fit.model))
    return again if again.evidence > one.evidence else one

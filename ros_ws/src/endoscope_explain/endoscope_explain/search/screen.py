"""What each term would gain, linearised, before it is fitted: all of them at once.

A term moves the residual along few directions. What is left of these after the numbers that are
free already have done their best is projected on the residual: Rao's score test with differences in
place of derivatives (Rao, Proc. Camb. Phil. Soc. 44, 1948), and with a normal prior on how much of
each direction there is, from which follows the evidence. The same directions, with residuals that
rigs of another form would have left, say what evidence means nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.workers import parallel_map
from endoscope_explain.fit.evidence import counts, log_likelihood, weights
from endoscope_explain.fit.model import Fit, JointModel
from endoscope_explain.search.term import Term, Variant, mirrored

Array = NDArray[np.float64]

PRIOR_SHARE = 0.1
"""Share of a channel's signal by which a function drawn from the prior moves the channel that it
moves most."""
_TRIAL = 1e-3
"""Share of the largest value that a function may have, of the one that is tried."""
_NOTHING = 1e-6
"""Squares in noise units below which a term does nothing."""


@dataclass(frozen=True)
class Background:
    """A fit, and what its own numbers cannot take away."""

    fit: Fit
    weight: Array = field(repr=False)  # (size,)
    # (size + n, n), orthonormal directions in which its numbers move weighted residuals and priors'
    # deviations.
    span: Array = field(repr=False)
    coarse: JointModel = field(repr=False)  # the same model on coarser ticks
    at: Array = field(repr=False)  # (size,), residuals of `coarse`

    @property
    def offset(self) -> Array:
        """What coarse ticks do to the residuals (size,)."""
        return self.fit.residuals - self.at

    def left(self, residuals: Array) -> Array:
        """What is left (size, ...) of weighted residuals once the model's numbers are refitted."""
        n = len(self.fit.theta)
        prior = self.fit.model.prior(self.fit.theta)
        deviations = prior if residuals.ndim == 1 else np.zeros((n, residuals.shape[1]))
        whole = np.concatenate([residuals, deviations])
        return np.asarray((whole - self.span @ (self.span.T @ whole))[: len(residuals)])


def background(found: Fit) -> Background:
    """What a fit leaves to terms that it does not have."""
    observation, model = found.model.observation, found.model
    weight = weights(observation, found.residuals)
    slopes = found.jacobian * weight[:, None]
    span, _ = np.linalg.qr(np.vstack([slopes, np.diag(model.prior_weight())]))
    coarse = model.on_coarse_ticks()
    return Background(found, weight, span, coarse, coarse.residuals(found.theta))


@dataclass(frozen=True)
class Directions:
    """Where a term moves weighted residuals once the model's own numbers are refitted."""

    term: Term
    columns: Array = field(repr=False)  # (size, k)


def directions(behind: Background, terms: tuple[Term, ...], jobs: int) -> tuple[Directions, ...]:
    """Directions of all terms that move anything."""
    found = parallel_map(lambda term: _directions(behind, term), terms, jobs)
    return tuple(each for each in found if each is not None)


def _directions(behind: Background, term: Term) -> Directions | None:
    if term.family is None:
        model = term.added_to(behind.coarse)
        moved = model.residuals(model.begun_at(behind.fit.theta)) - behind.at
        columns = behind.left((moved * behind.weight)[:, None])
        return Directions(term, columns) if float(np.sum(columns**2)) > _NOTHING else None
    trial = replace(term, family=term.family.scaled(_TRIAL * term.family.largest))
    model = trial.added_to(behind.coarse)
    begun = model.begun_at(behind.fit.theta)
    places = model.places_of_coefficients()[-1]
    answers = np.empty((len(behind.at), len(places)))
    for k, place in enumerate(places):
        moved = begun.copy()
        moved[place] = 1.0 / model.free[place].unit
        answers[:, k] = (model.residuals(moved) - behind.at) * behind.weight
    size = _relative_size(behind, answers)
    if size <= 0.0:
        return None
    amplitude = PRIOR_SHARE / size
    assert trial.family is not None
    scaled = replace(term, family=trial.family.scaled(amplitude))
    return Directions(scaled, behind.left(amplitude * answers))


def _relative_size(behind: Background, answers: Array) -> float:
    """By what share of its signal the channel moves that moves most, rms over the prior."""
    shares = [0.0]
    observation = behind.fit.model.observation
    for channel, part in zip(observation.channels, observation.slices(), strict=True):
        signal = (channel.value - np.mean(channel.value)) / channel.noise * behind.weight[part]
        size = float(np.sum(signal**2))
        if size > 0.0:
            shares.append(float(np.sqrt(np.sum(answers[part] ** 2) / size)))
    return max(shares)


@dataclass(frozen=True)
class Gains:
    """Gains of all terms on several residuals, from inner products alone."""

    values: Array  # (terms, B)
    # (terms, B, C), mean squares of each channel, weighted, that the best of each term leaves.
    left: Array


def gains(behind: Background, found: tuple[Directions, ...], residuals: Array) -> Gains:
    """What each term gains on several weighted residuals (size, B) that no refit takes away."""
    observation = behind.fit.model.observation
    number = counts(observation)
    parts = observation.slices()
    # Weighted by what the fit left: the sensor's own noise is this much less than one there.
    floor = np.array([behind.weight[part][0] ** 2 for part in parts])
    before = np.stack([np.mean(residuals[part] ** 2, axis=0) for part in parts], axis=-1)
    base = log_likelihood(before / floor, number)
    values = np.empty((len(found), residuals.shape[1]))
    left = np.empty((len(found), residuals.shape[1], len(parts)))
    for i, each in enumerate(found):
        grams = [each.columns[part].T @ each.columns[part] for part in parts]
        towards = [each.columns[part].T @ residuals[part] for part in parts]
        precision = np.sum(grams, axis=0) + np.eye(each.columns.shape[1])
        if each.term.is_linear:
            shares = -np.linalg.solve(precision, np.sum(towards, axis=0))
            _, volume = np.linalg.slogdet(precision)
        else:
            shares, volume = np.ones((1, residuals.shape[1])), 0.0
        for c, (gram, toward) in enumerate(zip(grams, towards, strict=True)):
            moved = 2.0 * np.sum(shares * toward, axis=0)
            moved += np.einsum('kb,kl,lb->b', shares, gram, shares)
            left[i, :, c] = before[:, c] + moved / number[c]
        price = 0.5 * np.sum(shares**2, axis=0) + 0.5 * volume
        values[i] = log_likelihood(left[i] / floor, number) - base
        values[i] -= price if each.term.is_linear else 0.0
    return Gains(values, left)


def screened(behind: Background, found: tuple[Directions, ...]) -> list[Term]:
    """Terms that help, by their linearised gain on the recording itself, the best one first."""
    residuals = behind.left(behind.fit.residuals * behind.weight)[:, None]
    gained = gains(behind, found, residuals).values[:, 0]
    ranked = (_sided(found[k], residuals) for k in np.argsort(-gained, kind='stable'))
    return [term for term in ranked if term is not None]


def by_variant(ranked: Iterable[Term]) -> list[list[Term]]:
    """Starting points of each variant, in the order in which variants come first."""
    starts: dict[Variant, list[Term]] = {}
    for term in ranked:
        starts.setdefault(term.variant, []).append(term)
    return list(starts.values())


def _sided(each: Directions, residuals: Array) -> Term | None:
    """The effect on the side of nothing on which it helps; None where it does not on any."""
    term = each.term
    helps = float((each.columns.T @ residuals)[0, 0]) < 0.0
    if term.is_function or helps or not term.is_linear:
        return term
    return mirrored(term)

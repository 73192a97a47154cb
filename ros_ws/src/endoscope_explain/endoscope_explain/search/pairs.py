"""What two terms explain together, before a search stops beside the one that was found first.

The term that explains most alone may stand for two others. The screen's directions say of every
pair what both gain together, linearised, at the price of inner products; the best few pairs are
fitted, in both orders, because each fit begins beside the numbers that the one before has left.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice, product

import numpy as np

from endoscope_core.workers import parallel_map
from endoscope_explain.fit.evidence import counts, log_likelihood
from endoscope_explain.recording import Array
from endoscope_explain.search.expansion import Parent, Screened
from endoscope_explain.search.refit import Candidate, converged, refit, trial_fit
from endoscope_explain.search.screen import Background, Directions, background
from endoscope_explain.search.term import Term, Variant, mirrored

PAIRS = 2
"""Pairs that are fitted, of all and of those that hold the term that was found last: a pair costs
two fits in each order, and the search for one term fits four."""


@dataclass(frozen=True)
class Pair:
    """Two terms, with what both gain together by the screen, in nats."""

    terms: tuple[Term, Term]
    gain: float

    @property
    def variants(self) -> frozenset[Variant]:
        """Of both."""
        return frozenset(term.variant for term in self.terms)


def better_pair(
    base: Screened, found: Sequence[Candidate], jobs: int
) -> tuple[Parent, Candidate] | None:
    """A pair with more evidence than all found, and its first term alone; None without one."""
    # `base` is the screen of the candidate that `found` has two terms more than, of one recording.
    best = max(found, key=lambda c: c.evidence, default=None)
    if best is None or best.is_noise:
        return None
    known = {term.variant for term in base.parent.candidate.terms}
    tried = {frozenset(term.variant for term in c.terms) - known for c in found}
    ranked = [p for p in ranked_pairs(base.behind[0], base.ways[0]) if p.variants not in tried]
    last = best.terms[-1].variant
    chosen = ranked[:PAIRS] + list(islice((p for p in ranked if last in p.variants), PAIRS))
    each_once = {pair.variants: pair.terms for pair in chosen}.values()
    orders = [order for first, second in each_once for order in ((first, second), (second, first))]
    fitted = parallel_map(lambda order: _fitted(base, *order), orders, jobs)
    one, both = max(fitted, key=lambda each: each[1].evidence, default=(None, best))
    if one is None or both.evidence <= best.evidence:
        return None
    return Parent.of(converged(one)), converged(both)


def _fitted(base: Screened, first: Term, second: Term) -> tuple[Candidate, Candidate]:
    """The base with the first term, and with both."""
    found, behind = base.parent.candidate, base.behind[0]
    one = refit((trial_fit(base.parent.references[0], first, behind.offset),), found)
    seen = trial_fit(one.fits, second, background(one.fit).offset)
    return one, refit((seen,), one)


def ranked_pairs(behind: Background, ways: Sequence[Directions]) -> list[Pair]:
    """All pairs that gain more together than either does alone, the best first."""
    if not ways:
        return []
    joint = _JointGains(behind, ways)
    alone = [joint.of(k)[0] for k in range(len(ways))]
    first: dict[Variant, int] = {}
    for k in np.argsort(alone)[::-1]:
        first.setdefault(ways[k].term.variant, int(k))
    found: dict[frozenset[Variant], Pair] = {}
    # Beside another term it may be another start of a variant that gains most: one is the best
    # alone, and the other any.
    for i, j in product(first.values(), range(len(ways))):
        one, other = ways[i].term, ways[j].term
        # Two functions of no known form bend to anything: at least one is a formula.
        if one.id == other.id or one.shares_place(other) or (one.is_function and other.is_function):
            continue
        gain, shares = joint.of(i, j)
        before = found.get(frozenset((one.variant, other.variant)))
        if gain <= max(alone[i], alone[j], before.gain if before else -math.inf):
            continue
        sided = _sided(one, shares[0]), _sided(other, shares[-1])
        if sided[0] is not None and sided[1] is not None:
            pair = Pair((sided[0], sided[1]), gain)
            found[pair.variants] = pair
    return sorted(found.values(), key=lambda pair: -pair.gain)


class _JointGains:
    """What terms gain together by the screen, from inner products; see `screen.gains`."""

    def __init__(self, behind: Background, ways: Sequence[Directions]) -> None:
        observation = behind.fit.model.observation
        residuals = behind.left(behind.fit.residuals * behind.weight)
        parts, self._number = observation.slices(), counts(observation)
        self._floor = np.array([behind.weight[part][0] ** 2 for part in parts])
        self._before = np.array([float(np.mean(residuals[part] ** 2)) for part in parts])
        self._base = float(log_likelihood(self._before / self._floor, self._number))
        columns = np.hstack([way.columns for way in ways])
        self._grams = np.array([columns[part].T @ columns[part] for part in parts])
        self._towards = np.array([columns[part].T @ residuals[part] for part in parts])
        sizes = [way.columns.shape[1] for way in ways]
        self._linear = np.repeat([way.term.is_linear for way in ways], sizes)
        self._places = np.split(np.arange(sum(sizes)), np.cumsum(sizes)[:-1])

    def of(self, *terms: int) -> tuple[float, Array]:
        """Gain in nats of some terms, and how much of each of their directions there is."""
        at = np.concatenate([self._places[k] for k in terms])
        free, shares = self._linear[at], np.ones(len(at))
        gram, toward = self._grams[:, at[:, None], at], self._towards[:, at]
        whole, price = gram.sum(axis=0), 0.0
        if free.any():
            precision = whole[np.ix_(free, free)] + np.eye(int(free.sum()))
            aim = toward.sum(axis=0)[free] + whole[np.ix_(free, ~free)].sum(axis=1)
            shares[free] = -np.linalg.solve(precision, aim)
            price = 0.5 * float(shares[free] @ shares[free] + np.linalg.slogdet(precision)[1])
        moved = 2.0 * toward @ shares + (gram @ shares) @ shares
        left = np.maximum(self._before + moved / self._number, 0.0)
        return float(log_likelihood(left / self._floor, self._number)) - self._base - price, shares


def _sided(term: Term, share: float) -> Term | None:
    """The term on the side of nothing on which it helps; None where there is none."""
    if term.is_function or not term.is_linear or share > 0.0:
        return term
    return mirrored(term)

"""The names that an answer leaves open, and how likely each of them is.

By evidence alone, one name of many has nearly all of the probability: a thousand samples agree on
it, and a law of slightly another form moves it by hundreds of nats all the same. So evidence is
read at a temperature, as is right where no model is (Grunwald, van Ommen, Bayesian Analysis 12,
2017), and beside the names stand two more hypotheses: that nothing is missing, and that it is
something that was not tried. What the temperature is in a recording like this one, how likely these
two are, and how far a set must go so that it holds the truth as often as it claims (Romano, Sesia,
Candes, NeurIPS 2020) was measured on rigs whose truth is known.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import softmax

from endoscope_core.physics.effects import CATALOGUE
from endoscope_explain.criteria import MASS, NAME_OF_FUNCTION, POSTERIOR

Array = NDArray[np.float64]

NOTHING, SOMETHING_ELSE, OTHER_NUMBERS = 'nothing', 'something else', 'other numbers'
_COLDEST, _HOTTEST = 1e-2, 1e6

Posterior = dict[tuple[str, ...], float]
"""Names, each with those that are one with it, and their probability, the likeliest first."""


@dataclass(frozen=True)
class Contest:
    """Names that were tried for one thing that may be missing from a joint."""

    # Each with those that the recording shows to be the same statement, the largest gain first.
    names: tuple[tuple[str, ...], ...]
    gains: tuple[float, ...]  # logarithm of the evidence over that without any, in nats
    form: float  # evidence in nats by which an error of form may mislead between names
    found: bool  # whether something is found to be missing
    beyond_form: float = 1.0  # what the chosen plant leaves over what another form leaves

    def without(self, others: Iterable[str]) -> 'Contest':
        """The same without names that are found besides."""
        gone = set(others)
        left = [
            (kept, gain)
            for own, gain in zip(self.names, self.gains, strict=True)
            if (kept := tuple(name for name in own if name not in gone))
        ]
        names, gains = tuple(n for n, _ in left), tuple(g for _, g in left)
        return replace(self, names=names, gains=gains)

    @property
    def statements(self) -> tuple[tuple[str, ...], ...]:
        """The names, nothing, and something else, in the order of their probabilities' array."""
        return *self.names, (NOTHING,), (SOMETHING_ELSE,)

    def temperature(self, more: float = 1.0) -> float:
        """By how much evidence is divided where it is read, once `more` times as much is there."""
        gains = [[more * gain for gain in self.gains]]
        return float(_temperature(gains, [self.form], [self.beyond_form], POSTERIOR)[0])

    def probabilities(self, weights: Sequence[float] | None = None) -> Array:
        """Probability (k + 2,) of each of the names, of nothing, and of something else."""
        weights = POSTERIOR if weights is None else weights
        odds = log_odds([self.gains], [self.form], [self.found], [self.beyond_form], weights)
        return np.asarray(softmax(odds[0]))

    def posterior(self) -> Posterior:
        """All that was tried, and nothing, and something else, with their probabilities."""
        chances = zip(self.statements, self.probabilities().tolist(), strict=True)
        return dict(sorted(chances, key=lambda each: -each[1]))

    def left_open(self, named: str) -> Posterior:
        """The part of it that holds the truth with 90 %, what was named in any case."""
        left: Posterior = {}
        before = 0.0
        for names, p in self.posterior().items():
            if before <= MASS or named in names:
                left[names] = p
            before += p
        return left

    def alternatives(self, named: str) -> tuple[str, ...]:
        """Names that are left open beside the one that was named, the likeliest first."""
        names = [name for each in self.left_open(named) for name in each]
        return tuple(n for n in names if n not in (named, NOTHING, SOMETHING_ELSE))

    @property
    def nameless(self) -> str:
        """The answer where no name is: other numbers, if these were tried, or nothing."""
        return OTHER_NUMBERS if any(OTHER_NUMBERS in n for n in self.names) else NOTHING

    def probability(
        self,
        named: str,
        weights: Sequence[float] | None = None,
        of_function: float = NAME_OF_FUNCTION,
    ) -> float:
        """Probability of what was named."""
        # A function at a place is mostly a form of the effect whose formula comes nearest.
        chances = self.probabilities(weights)
        places = CATALOGUE[named].traits.families if named in CATALOGUE else ()
        return float(
            sum(
                p if named in names else of_function * p * any(n in places for n in names)
                for names, p in zip(self.names, chances, strict=False)
            )
        )


def log_odds(
    gains: ArrayLike,
    form: ArrayLike,
    found: ArrayLike,
    beyond_form: ArrayLike,
    weights: Sequence[float],
) -> Array:
    """Logarithm (m, k + 2) of the odds of names, nothing and something else, of m contests."""
    # `gains` (m, k) are minus infinity where there is no name.
    w, gained = np.array(weights), np.array(gains, dtype=float)
    top = np.max(gained, axis=1, initial=0.0)
    left = np.log1p(np.array(beyond_form))
    names = (gained - top[:, None]) / _temperature(gained, form, beyond_form, weights)[:, None]
    nothing = w[4] + w[5] * np.array(found) + w[6] * np.log1p(top)
    return np.column_stack([names, nothing, w[7] + w[8] * left])


def _temperature(
    gains: ArrayLike, form: ArrayLike, beyond_form: ArrayLike, weights: Sequence[float]
) -> Array:
    """Temperature (m,) of the evidence of m contests."""
    top = np.max(np.array(gains, dtype=float), axis=1, initial=0.0)
    left = np.log1p(np.array(beyond_form))
    of = np.stack([np.ones_like(top), np.log1p(top), np.log1p(np.maximum(form, 0.0)), left])
    bounds = math.log(_COLDEST), math.log(_HOTTEST)
    return np.asarray(np.exp(np.clip(np.array(weights)[:4] @ of, *bounds)))

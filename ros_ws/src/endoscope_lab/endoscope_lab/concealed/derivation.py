"""The numbers by which explanations are judged, derived from cases with known truth."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from textwrap import fill

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import softmax

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import EndoscopeError
from endoscope_explain.prediction_set import log_odds
from endoscope_lab.concealed.row import Row
from endoscope_lab.concealed.sets import JudgedContest


def derive(rows: Sequence[Row], write: Path | None) -> None:
    """Print criteria derived from rows, and write them if asked; EndoscopeError if rows are few."""
    bank = bank_of(rows)
    try:
        criteria = derived(bank)
    except ValueError as error:
        raise EndoscopeError(str(error)) from error
    seeds = _in_words(sorted({row.seed for row in rows}))
    strata = ', '.join(dict.fromkeys(row.stratum for row in rows))
    cases = f'{len(rows)} cases, seeds {seeds} of {strata}'
    made_by = f'`endoscope bench concealed --derive` from {cases}'
    print(sensitivity(bank, criteria))
    print('\n' + reliability(bank))
    if write:
        write_text(write, source(criteria, made_by))


def _in_words(seeds: list[int]) -> str:
    """Increasing numbers, with consecutive ones as a range."""
    begins = [n for n in seeds if n - 1 not in seeds]
    ends = [n for n in seeds if n + 1 not in seeds]
    return ', '.join(f'{a} to {b}' if a < b else f'{a}' for a, b in zip(begins, ends, strict=True))


Array = NDArray[np.float64]

HOLDS = 0.9
"""Coverage of intervals."""
ADEQUATE = 0.95
"""Share of right explanations that are called adequate."""
PARTS = 10
PRIOR = np.array([3.0, 1.0, 1.0, 1.0, 3.0, 3.0, 1.0, 3.0, 3.0])
"""Prior standard deviations of the weights: evidence in nats scales with any quantity by a power of
about one at most, and odds are a few powers of e."""
LEAST = 1e-6
"""Probability below which a wrong name costs no more, so that one case cannot decide alone."""


@dataclass(frozen=True)
class Criteria:
    """Deciding numbers; their meaning is in `endoscope_explain.criteria`."""

    BEYOND_FORM: float
    INTERVAL_WIDTH: float
    POSTERIOR: tuple[float, ...]
    MASS: float
    NAME_OF_FUNCTION: float


@dataclass(frozen=True)
class Bank:
    """Results of the cases, without NaN."""

    beyond: Array  # (k,), residual over that of rigs of another form
    exact: NDArray[np.bool_]  # (k,), whether the report was exactly right
    errors: Array  # (l,), of numbers, over the half-width of intervals of an `INTERVAL_WIDTH` of 1
    contests: tuple[JudgedContest, ...]
    case: NDArray[np.int64]  # (m,), number of each contest's case

    @cached_property
    def crossed(self) -> list[tuple[JudgedContest, tuple[float, ...], float]]:
        """Each contest with weights, and the chance of a function's name, from other cases."""
        # Cross-validation by tenths: weights from the same case would overrate what is right.
        found = []
        for part in range(PARTS):
            own = self.case % PARTS == part
            others = [c for c, mine in zip(self.contests, own, strict=True) if not mine]
            weights, of_function = _likeliest(others), _name_of_function(others)
            found += [
                (c, weights, of_function)
                for c, mine in zip(self.contests, own, strict=True)
                if mine
            ]
        return found


def bank_of(rows: Sequence[Row]) -> Bank:
    left = [row for row in rows if math.isfinite(row.beyond_form)]
    errors = np.array([e for row in rows if row.exact for e in row.errors])
    found = [(n, JudgedContest.of_row(each)) for n, row in enumerate(rows) for each in row.contests]
    return Bank(
        np.array([row.beyond_form for row in left]),
        np.array([row.exact for row in left], dtype=bool),
        errors[np.isfinite(errors)],
        tuple(contest for _, contest in found),
        np.array([n for n, _ in found], dtype=np.int64),
    )


def derived(bank: Bank) -> Criteria:
    """Derive criteria from a bank of cases; ValueError if it has too few for the quantiles."""
    return Criteria(
        # A residual no larger than that of rigs of another form is always adequate.
        max(conformal(bank.beyond[bank.exact], ADEQUATE), 1.0),
        conformal(bank.errors, HOLDS),
        _likeliest(bank.contests),
        conformal(_before_truth(bank), HOLDS),
        _name_of_function(bank.contests),
    )


def _name_of_function(contests: Sequence[JudgedContest]) -> float:
    """Share of right names where a function at their place is right, by Laplace's rule."""
    named = [each.reported_is_right for each in contests if each.is_of_function]
    return (1.0 + sum(named)) / (2.0 + len(named))


def _before_truth(bank: Bank) -> Array:
    """Probability (m,) of all names likelier than the truth; zero where the truth is reported."""
    found = []
    for each, weights, _ in bank.crossed:
        chances = each.contest.probabilities(weights)
        right = float(np.max(chances[np.array(each.right)], initial=0.0))
        above = float(np.sum(chances[chances > right]))
        # A reported name is in every set.
        found.append(0.0 if each.reported_is_right else above)
    return np.array(found)


def _likeliest(contests: Sequence[JudgedContest]) -> tuple[float, ...]:
    """Weights under which the right names are likeliest, with a prior that bounds them."""
    tried = [each.contest for each in contests]
    most = max(len(each.names) for each in tried)
    gains = np.full((len(tried), most), -np.inf)
    right = np.zeros((len(tried), most + 2), dtype=bool)
    for k, each in enumerate(contests):
        own = len(each.contest.gains)
        gains[k, :own] = each.contest.gains
        right[k, :own], right[k, -2:] = each.right[:own], each.right[own:]
    form, found, beyond = (
        np.array([getattr(each, name) for each in tried])
        for name in ('form', 'found', 'beyond_form')
    )

    def cost(weights: Array) -> float:
        odds = log_odds(gains, form, found, beyond, weights.tolist())
        chances = np.sum(softmax(odds, axis=1), axis=1, where=right)
        return 0.5 * float(np.sum((weights / PRIOR) ** 2) - 2.0 * np.sum(np.log(chances + LEAST)))

    found_at = minimize(cost, np.zeros(len(PRIOR)), method='BFGS')
    return tuple(found_at.x.tolist())


def reliability(bank: Bank) -> str:
    """Calibration table: share of right names by reported probability, a line for each tenth."""
    named = [each for each in bank.crossed if each[0].contest.found]
    chances = np.array([c.contest.probability(c.reported, w, share) for c, w, share in named])
    is_right = np.array([c.reported_is_right for c, *_ in named], dtype=bool)
    lines = [f'{"probability":>14s}{"names":>7s}{"mean":>8s}{"right":>8s}']
    for tenth in range(10):
        inside = np.minimum((10.0 * chances).astype(int), 9) == tenth
        if np.any(inside):
            ends = f'{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}'
            mean, share = np.mean(chances[inside]), np.mean(is_right[inside])
            lines.append(f'{ends:>14s}{np.sum(inside):7d}{mean:8.2f}{share:8.2f}')
    off = np.mean((chances - is_right) ** 2)
    flat = np.mean((np.mean(is_right) - is_right) ** 2)
    lines.append(f'Brier score {off:.3f}, of one probability for all {flat:.3f}')
    return '\n'.join(lines)


def conformal(scores: Array, chance: float) -> float:
    """Limit that the next score stays below with a chance; ValueError if scores are too few."""
    rank = math.ceil((len(scores) + 1) * chance)
    if rank > len(scores):
        raise ValueError(f'{len(scores)} scores are too few for a chance of {chance}: give more')
    return float(np.sort(scores)[rank - 1])


def sensitivity(bank: Bank, criteria: Criteria) -> str:
    """Effect of halving and doubling each number on the bank, a line each."""
    lines = [f'{"":14s}{"half":>24s}{"derived":>24s}{"double":>24s}  meaning']

    def line(name: str, meaning: str, of: list[str]) -> None:
        lines.append(f'{name:14s}' + ''.join(f'{each:>24s}' for each in of) + f'  {meaning}')

    def adequate(limit: float) -> str:
        right, wrong = bank.beyond[bank.exact], bank.beyond[~bank.exact]
        shares = [f'{np.mean(each <= limit):.0%}' if len(each) else '-' for each in (right, wrong)]
        return f'{limit:.3g}: {shares[0]}, {shares[1]}'

    def hold(factor: float) -> str:
        return f'{factor:.3g}: {np.mean(bank.errors <= factor):.0%}'

    of_three = (0.5, 1.0, 2.0)
    line(
        'BEYOND_FORM',
        'right, and wrong explanations called adequate',
        [adequate(k * criteria.BEYOND_FORM) for k in of_three],
    )
    line(
        'INTERVAL_WIDTH',
        'intervals that hold',
        [hold(k * criteria.INTERVAL_WIDTH) for k in of_three],
    )
    return '\n'.join(lines)


def source(criteria: Criteria, made_by: str) -> str:
    """Source of the module that holds the criteria."""
    origin = fill(f'Made by {made_by}.', 100)
    return f'''"""Numbers by which explanations are judged, derived from cases whose truth is known.

{origin}
"""

BEYOND_FORM = {criteria.BEYOND_FORM:.3g}
"""Limit of the residual over that of the worst rig of another form, for the worst channel: one, or
what {ADEQUATE:.0%} of right explanations stay below."""
INTERVAL_WIDTH = {criteria.INTERVAL_WIDTH:.3g}
"""Factor on intervals that makes them contain {HOLDS:.0%} of the true numbers."""
POSTERIOR = ({', '.join(f'{weight:.3g}' for weight in criteria.POSTERIOR)})
"""Weights of the logarithm of the temperature of evidence: of one, and of the logarithms of the
largest gain, of the gain of the form, and of the residual over that of rigs of another form. Then
of the odds of nothing: of one, of whether something is reported missing, and of the logarithm of
the largest gain. Then of the odds of something else: of one, and of the residual."""
MASS = {criteria.MASS:.3g}
"""Probability of the likeliest names up to which a prediction set takes one more."""
NAME_OF_FUNCTION = {criteria.NAME_OF_FUNCTION:.3g}
"""Chance that a function is a form of the effect whose formula is nearest at its place."""
'''

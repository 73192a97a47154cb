"""The numbers by which explanations are judged, derived from cases whose truth is known."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import fill

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from endoscope_core.atomic_output import write_text
from endoscope_core.errors import EndoscopeError
from endoscope_explain.decide.decision import features, probability
from endoscope_lab.concealed.row import Row


def derive(rows: Sequence[Row], write: Path | None) -> None:
    """Print what the criteria of rows would do, and write them if asked; EndoscopeError if few."""
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
    """Increasing numbers, each stretch by its ends."""
    begins = [n for n in seeds if n - 1 not in seeds]
    ends = [n for n in seeds if n + 1 not in seeds]
    return ', '.join(f'{a} to {b}' if a < b else f'{a}' for a, b in zip(begins, ends, strict=True))


Array = NDArray[np.float64]

HOLDS = 0.9
"""Chance with which intervals hold the true number."""
ADEQUATE = 0.95
"""Share of right explanations that are called adequate."""
PARTS = 10
WIDE = 10.0
"""Standard deviation of a weight before anything is known: odds of e to the power of ten."""


@dataclass(frozen=True)
class Criteria:
    """Deciding numbers; their meaning is in `endoscope_explain.criteria`."""

    BEYOND_FORM: float
    INTERVAL_WIDTH: float
    CERTAINTY: tuple[float, float, float]


@dataclass(frozen=True)
class Bank:
    """What the cases say, with NaN left out."""

    beyond: Array  # (k,), what is left over what another form leaves
    exact: NDArray[np.bool_]  # (k,), whether all was said rightly
    errors: Array  # (l,), of numbers, over what intervals of an `INTERVAL_WIDTH` of one allow
    named: Array  # (m, 3), features of each name that was given; see `certainty.features`
    right: NDArray[np.bool_]  # (m,), whether it is right
    case: NDArray[np.int64]  # (m,), number of its case


def bank_of(rows: Sequence[Row]) -> Bank:
    left = [row for row in rows if math.isfinite(row.beyond_form)]
    errors = np.array([e for row in rows if row.exact for e in row.errors])
    named = [(n, row, each) for n, row in enumerate(rows) for each in row.evidence]
    return Bank(
        np.array([row.beyond_form for row in left]),
        np.array([row.exact for row in left], dtype=bool),
        errors[np.isfinite(errors)],
        np.array(
            [features(each['gain'], each['margin'], row.beyond_form) for _, row, each in named]
        ).reshape(-1, 3),
        np.array([each['right'] > 0.0 for *_, each in named], dtype=bool),
        np.array([n for n, *_ in named], dtype=np.int64),
    )


def derived(bank: Bank) -> Criteria:
    """Criteria from a bank of cases; ValueError if it has too few for the quantiles."""
    return Criteria(
        # What no more than another form leaves is adequate, whatever right explanations leave.
        max(conformal(bank.beyond[bank.exact], ADEQUATE), 1.0),
        conformal(bank.errors, HOLDS),
        _logistic(bank.named, bank.right),
    )


def _logistic(named: Array, right: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Weights (3,) of the features that are most likely, with a wide prior that bounds them."""

    def cost(weights: Array) -> float:
        sign = np.where(right, 1.0, -1.0)
        likely = np.sum(np.logaddexp(0.0, -sign * (named @ weights)))
        return float(likely + 0.5 * np.sum((weights / WIDE) ** 2))

    a, b, c = minimize(cost, np.zeros(3), method='BFGS').x.tolist()
    return a, b, c


def reliability(bank: Bank) -> str:
    """How often names are right that were given with some probability, a line for each tenth."""
    # The probability of a name follows from the other cases, ten parts of them in turn.
    given = np.empty(len(bank.right))
    for part in range(PARTS):
        own = bank.case % PARTS == part
        given[own] = probability(bank.named[own], _logistic(bank.named[~own], bank.right[~own]))
    lines = [f'{"probability":>14s}{"names":>7s}{"mean":>8s}{"right":>8s}']
    for tenth in range(10):
        inside = np.minimum((10.0 * given).astype(int), 9) == tenth
        if np.any(inside):
            mean, right = np.mean(given[inside]), np.mean(bank.right[inside])
            ends = f'{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}'
            lines.append(f'{ends:>14s}{np.sum(inside):7d}{mean:8.2f}{right:8.2f}')
    off = np.mean((given - bank.right) ** 2)
    flat = np.mean((np.mean(bank.right) - bank.right) ** 2)
    lines.append(f'Brier score {off:.3f}, of one probability for all {flat:.3f}')
    return '\n'.join(lines)


def conformal(scores: Array, chance: float) -> float:
    """Limit that the next score does not exceed with a chance; ValueError if scores are too few."""
    rank = math.ceil((len(scores) + 1) * chance)
    if rank > len(scores):
        raise ValueError(f'{len(scores)} scores are too few for a chance of {chance}: give more')
    return float(np.sort(scores)[rank - 1])


def sensitivity(bank: Bank, criteria: Criteria) -> str:
    """What half and double of each number would do on the bank, a line each."""
    lines = [f'{"":14s}{"half":>24s}{"derived":>24s}{"double":>24s}  says']

    def line(name: str, says: str, of: list[str]) -> None:
        lines.append(f'{name:14s}' + ''.join(f'{each:>24s}' for each in of) + f'  {says}')

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
    """The module that holds them."""
    origin = fill(f'Made by {made_by}.', 100)
    return f'''"""Numbers by which explanations are judged, derived from cases whose truth is known.

{origin}
"""

BEYOND_FORM = {criteria.BEYOND_FORM:.3g}
"""What is left over what the worst rig of another form leaves, of the worst channel: one, or what
{ADEQUATE:.0%} of right explanations stay below."""
INTERVAL_WIDTH = {criteria.INTERVAL_WIDTH:.3g}
"""Factor on intervals that makes them hold {HOLDS:.0%} of the true numbers."""
CERTAINTY = ({', '.join(f'{weight:.3g}' for weight in criteria.CERTAINTY)})
"""Weights of the features of a name in the logarithm of the odds that it is right."""
'''

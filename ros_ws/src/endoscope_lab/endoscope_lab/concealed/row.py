"""A case of the benchmark as a row: injected laws, reported names, and how far these are right."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isclose
from pathlib import Path
from typing import Any

import numpy as np

from endoscope_explain.criteria import INTERVAL_WIDTH
from endoscope_lab.bench import kept_rows, table_head, table_row
from endoscope_lab.concealed.judge import Correctness
from endoscope_lab.concealed.sets import JudgedContest, all_hold, mean_size

GOOD = 1.3
"""Rmse over noise up to which a second recording is predicted."""
COLUMNS = (
    *('stratum', 'cases', 'identifiable', 'of these named first', 'of all', 'right place'),
    *('exact set', 'false names', 'in set', 'names a set', 'intervals', 'described', 'refitted'),
    *('improved', '80th', 's, median', '95th'),
)


@dataclass(frozen=True, kw_only=True)
class Row(Correctness):
    """Injected laws, reported names, and how far these are right."""

    stratum: str
    seed: int
    concealed: tuple[str, ...]  # laws with their joints
    note: str  # particulars of the case
    moved: float  # change by the laws, over the signal
    left: float  # what a refit of the rig's numbers leaves of them, over noise
    verdict: str
    reported: tuple[str, ...]  # names with their joints, most certain first
    # Intervals that contain the true number, and their count: those of the plant, and of the
    # numbers of named effects that could be measured another way.
    held: int = 0
    intervals: int = 0
    # Misfit of the second recording over noise, for the worst signal.
    nominal: float = math.nan
    refitted: float = math.nan
    augmented: float = math.nan
    seconds: float = math.nan  # that explaining took
    # Residual over that of rigs of another form, for the worst joint.
    beyond_form: float = math.nan
    # Error of each number over what its interval would allow on that side with an `INTERVAL_WIDTH`
    # of one.
    errors: tuple[float, ...] = ()
    contests: tuple[dict[str, Any], ...] = ()  # as in `sets.JudgedContest`
    # Laws that no change of the rig's numbers imitates, and whether the first statements name them.
    identifiable: tuple[str, ...] = ()
    first_of_identifiable: bool = True

    @property
    def is_identifiable(self) -> bool:
        """Whether a null case, or laws that refitted numbers do not imitate in either recording."""
        return not self.concealed or (bool(self.identifiable) and not self.refitted <= GOOD)

    def line(self) -> str:
        right = 'right' if self.exact else 'first' if self.first else 'place' if self.place else ''
        ratios = ' > '.join(f'{x:.3g}' for x in (self.nominal, self.refitted, self.augmented))
        note = f' [{self.note}]' if self.note else ''
        return (
            f'{self.stratum:17s}{self.seed:4d}  {right or "WRONG":6s}{self.seconds:6.1f} s  '
            f'{" + ".join(self.concealed) or "nothing"}{note}, moves {100.0 * self.moved:.0f} %, '
            f'a refit leaves {self.left:.2g}: '
            f'{self.verdict}, {" + ".join(self.reported) or "nothing"}; second {ratios}'
        )


def table(rows: Sequence[Row]) -> str:
    """A line for each stratum, and one for all."""
    strata = dict.fromkeys(row.stratum for row in rows)
    lines = {f'`{name}`': [row for row in rows if row.stratum == name] for name in strata}
    lines['all'] = list(rows)
    shown = (table_row(name, *_cells(of_it)) for name, of_it in lines.items())
    return '\n'.join([table_head(*COLUMNS), *shown])


def _cells(rows: Sequence[Row]) -> tuple[str, ...]:
    def share(name: str, of: Sequence[Row] = rows) -> str:
        return f'{100.0 * np.mean([getattr(row, name) for row in of]):.0f} %' if of else '-'

    def second(name: str, quantile: float = 0.5) -> str:
        values = np.array([getattr(row, name) for row in rows])
        # A failed explanation predicts nothing.
        values[np.isnan(values)] = np.inf
        return f'{np.quantile(values, quantile):.3g}'

    identifiable = [row for row in rows if row.is_identifiable]
    intervals = sum(row.intervals for row in rows)
    held = f'{100.0 * sum(row.held for row in rows) / intervals:.0f} %' if intervals else '-'
    seconds = [row.seconds for row in rows if not np.isnan(row.seconds)] or [math.nan]
    sizes = [row.set_size for row in rows if not np.isnan(row.set_size)] or [math.nan]
    return (
        str(len(rows)),
        str(len(identifiable)),
        share('first_of_identifiable', identifiable),
        share('first'),
        share('place'),
        share('exact'),
        str(sum(row.false for row in rows)),
        share('in_set'),
        f'{np.mean(sizes):.1f}',
        held,
        second('nominal'),
        second('refitted'),
        second('augmented'),
        second('augmented', 0.8),
        f'{np.median(seconds):.1f}',
        f'{np.quantile(seconds, 0.95):.1f}',
    )


CaseKey = tuple[str, int]
"""Stratum and seed."""

SAME = 0.02
"""Relative difference of a misfit between two machines: fits end within a thousandth of their cost,
of which a misfit of twice the noise is a hundredth."""


def rows_of(file: Path) -> dict[CaseKey, Row]:
    """Read a record, with sets and intervals by the present criteria.

    EndoscopeError for a line that is not a row.
    """
    return {(row.stratum, row.seed): _by_criteria(row) for row in kept_rows(file, Row)}


def _by_criteria(row: Row) -> Row:
    if row.verdict == 'FAILED':
        return row
    contests = [JudgedContest.of_row(each) for each in row.contests]
    held = sum(error <= INTERVAL_WIDTH for error in row.errors)
    return replace(row, in_set=all_hold(contests), set_size=mean_size(contests), held=held)


def differences(before: Row, now: Row) -> Iterator[str]:
    """How an explanation differs from the one on record: verdict, names, misfits, intervals."""
    for name in ('verdict', 'reported'):
        was, is_ = getattr(before, name), getattr(now, name)
        if was != is_:
            yield f'{name} {_shown(was)} -> {_shown(is_)}'
    for name in ('nominal', 'refitted', 'augmented'):
        was, is_ = getattr(before, name), getattr(now, name)
        if not isclose(was, is_, rel_tol=SAME):
            yield f'second recording, {name}: {was:.3g} -> {is_:.3g}'
    if before.held != now.held or before.intervals != now.intervals:
        yield (
            f'intervals that hold: {before.held} of {before.intervals} -> '
            f'{now.held} of {now.intervals}'
        )


def _shown(value: str | tuple[str, ...]) -> str:
    return value if isinstance(value, str) else ' + '.join(value) or 'nothing'

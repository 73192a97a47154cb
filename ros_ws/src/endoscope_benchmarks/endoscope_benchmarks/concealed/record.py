"""The record of explained cases: a line of JSON for each, kept as soon as it is known."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from math import isclose
from pathlib import Path

from endoscope_benchmarks.concealed.trial import Row
from endoscope_core.errors import EndoscopeError

CaseKey = tuple[str, int]
"""Stratum and seed."""

SAME = 0.02
"""Relative difference of a misfit that two machines may have: fits end within a thousandth of their
cost, in which a misfit of twice the noise has a share of a hundredth."""


def rows_of(file: Path) -> dict[CaseKey, Row]:
    """Read a record; EndoscopeError for a line that is none of a row."""
    rows = {}
    for number, line in enumerate(file.read_text(encoding='utf-8').splitlines(), 1):
        try:
            fields = json.loads(line)
            lists = {k: tuple(v) for k, v in fields.items() if isinstance(v, list)}
            row = Row(**{**fields, **lists})
        except (ValueError, TypeError) as error:
            raise EndoscopeError(f'{file}, line {number}: no row of a case: {error}') from error
        rows[row.stratum, row.seed] = row
    return rows


def append(file: Path, row: Row) -> None:
    """Add a row at the end of a record."""
    with file.open('a', encoding='utf-8') as lines:
        lines.write(json.dumps(asdict(row)) + '\n')


def differences(before: Row, now: Row) -> Iterator[str]:
    """In what an explanation differs from the one on record: verdict, names, misfits, numbers."""
    for name in ('verdict', 'said'):
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

"""`endoscope bench limits`: how weak an effect may be and still be named."""

import argparse

from endoscope_core.physics.effects import CATALOGUE
from endoscope_lab.bench import require_known, side_by_side, table_row
from endoscope_lab.concealed.forms import DRAWN
from endoscope_lab.concealed.judge import Case
from endoscope_lab.concealed.strata import as_strong
from endoscope_lab.concealed.trial import row_of


def run(args: argparse.Namespace) -> int:
    """Print a line for each effect; return 0."""
    require_known('drawn effect', args.effects or (), DRAWN)
    calls = [(effect, args.seeds) for effect in args.effects or DRAWN]
    for _, future in side_by_side(args.jobs, limit_of, calls):
        print(future.result(), flush=True)
    return 0


SHARES = (0.1, 0.032, 0.01, 0.0032, 0.001)
"""Shares of its signal that the effect moves, each about a third of the one before."""


def limit_of(effect: str, seeds: range) -> str:
    """Make an effect weaker until it is not named on each of some rigs, one a seed; as a row."""
    named, numbers, missed = 'never', list[str](), list[str]()
    for share in SHARES:
        cases = [case for seed in seeds if (case := _drawn(effect, seed, share)) is not None]
        rows = [row_of(case) for case in cases]
        missed = ['+'.join(row.said) or 'nothing' for row in rows if not row.first]
        if missed:
            break
        if cases:
            named, numbers = f'{100.0 * share:.2g} %', [_in_units(case, effect) for case in cases]
    return table_row(f'`{effect}`', named, '; '.join(numbers), ', '.join(missed) or '-')


def _drawn(effect: str, seed: int, share: float) -> Case | None:
    """The case; None where the effect cannot move as much, since it has an end."""
    try:
        return as_strong(effect, seed, (share, share))
    except RuntimeError:
        return None


def _in_units(case: Case, effect: str) -> str:
    """What a person knows the strength by: the numbers that vanish with the effect, with units."""
    spec = next(each for each in case.true.effects if each.id == effect)
    return ', '.join(
        f'{p.name} {spec.parameters[p.name]:.3g}{"" if p.unit == "-" else f" {p.unit}"}'
        for p in CATALOGUE[effect].parameters
        if p.off == p.off and spec.parameters[p.name] != p.off
    )

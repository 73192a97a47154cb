"""`endoscope bench criteria`: derive the numbers by which explanations are judged."""

import argparse
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `criteria`."""
    parser = subparsers.add_parser(
        'criteria',
        help='derive the numbers by which explanations are judged',
        description='Reads rows of `endoscope bench concealed --json`, derives the numbers of '
        'endoscope_explain/criteria.py from them, and prints what half and double of each would '
        'do.',
    )
    parser.add_argument('rows', nargs='+', type=Path, metavar='FILE', help='of rows')
    parser.add_argument('--write', type=Path, metavar='FILE', help='module to write')


def run(args: argparse.Namespace) -> int:
    """Print, and write if asked; return 0."""
    from endoscope_benchmarks.concealed.criteria import (
        bank_of,
        derived,
        reliability,
        sensitivity,
        source,
    )
    from endoscope_benchmarks.concealed.trial import rows_of
    from endoscope_core.atomic_output import write_text
    from endoscope_core.errors import EndoscopeError

    rows = [row for file in args.rows for row in rows_of(file).values()]
    bank = bank_of(rows)
    try:
        criteria = derived(bank)
    except ValueError as error:
        raise EndoscopeError(str(error)) from error
    seeds = _in_words(sorted({row.seed for row in rows}))
    strata = ', '.join(dict.fromkeys(row.stratum for row in rows))
    made_by = (
        f'`endoscope bench criteria` from {len(rows)} cases of `endoscope bench concealed`, '
        f'seeds {seeds} of {strata}'
    )
    print(sensitivity(bank, criteria))
    print('\n' + reliability(bank))
    if args.write:
        write_text(args.write, source(criteria, made_by))
    return 0


def _in_words(seeds: list[int]) -> str:
    """Increasing numbers, each stretch by its ends."""
    begins = [n for n in seeds if n - 1 not in seeds]
    ends = [n for n in seeds if n + 1 not in seeds]
    return ', '.join(f'{a} to {b}' if a < b else f'{a}' for a, b in zip(begins, ends, strict=True))

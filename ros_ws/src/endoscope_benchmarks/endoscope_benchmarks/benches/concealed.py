"""`endoscope bench concealed`: what is said of rigs with something drawn and concealed."""

import argparse
from pathlib import Path

from endoscope_benchmarks.bench import add_case_options, require_known, side_by_side


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `concealed`."""
    parser = subparsers.add_parser(
        'concealed',
        help='explain rigs that are drawn with something concealed in them',
        description='Draws rigs with something concealed, explains a recording of each, and prints '
        'a line for each case and a table. Every seed is a case of every stratum. Seeds from 1 to '
        '99 are for development; of others, first runs are reported. With --json each case is kept '
        'once it is known, and what the file has is not explained again: a long run goes on where '
        'it was stopped. Exits 1 if a case could not be explained, or differs from --against.',
    )
    add_case_options(parser)
    parser.add_argument(
        '--against',
        type=Path,
        metavar='FILE',
        help='rows of an earlier run: explain the same cases, and say what differs',
    )


def run(args: argparse.Namespace) -> int:
    """Print a line for each case, then the table; return 1 if a case failed or differs."""
    from endoscope_benchmarks.concealed.strata import STRATA
    from endoscope_benchmarks.concealed.trial import (
        append,
        differences,
        explained,
        failed,
        rows_of,
        table,
    )

    strata = args.stratum or list(STRATA)
    require_known('stratum', strata, STRATA)
    before = rows_of(args.against) if args.against else {}
    cases = list(before) or [(name, seed) for seed in args.seeds for name in strata]
    kept = rows_of(args.json) if args.json and args.json.exists() else {}
    rows = {case: kept[case] for case in cases if case in kept}
    for case, future in side_by_side(args.jobs, explained, [c for c in cases if c not in rows]):
        error = future.exception()
        rows[case] = failed(*case, error) if error else future.result()
        print(rows[case].line(), flush=True)
        if args.json:
            append(args.json, rows[case])
    known = list(STRATA)
    print('\n' + table([rows[case] for case in sorted(cases, key=lambda c: known.index(c[0]))]))
    differ = [(c, each) for c in before for each in differences(before[c], rows[c])]
    for (stratum, seed), each in differ:
        print(f'{stratum} {seed}: {each}')
    if before:
        print(f'{len(differ)} differences from {args.against} in {len(before)} cases')
    return 1 if differ or any(row.verdict == 'FAILED' for row in rows.values()) else 0

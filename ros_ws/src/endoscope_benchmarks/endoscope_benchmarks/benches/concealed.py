"""`endoscope bench concealed`: what is said of rigs with something concealed that is drawn anew."""

import argparse

from endoscope_benchmarks.benches.cases import (
    add_case_options,
    of_cases,
    require_known,
    write_rows,
)


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `concealed`."""
    parser = subparsers.add_parser(
        'concealed',
        help='explain rigs that are drawn with something concealed in them',
        description='Draws rigs with something concealed, explains a recording of each, and prints '
        'a line for each case and a table. Every seed is a case of every stratum. Seeds from 1 to '
        '99 are for development; of others, first runs are reported. Exits 1 if a case could not '
        'be explained.',
    )
    add_case_options(parser)


def run(args: argparse.Namespace) -> int:
    """Print a line for each case, then the table; return 1 if a case failed."""
    from endoscope_benchmarks.concealed.strata import STRATA
    from endoscope_benchmarks.concealed.trial import explained, failed, table

    strata = args.stratum or list(STRATA)
    require_known('stratum', strata, STRATA)
    rows = {}
    for case, future in of_cases(args, strata, explained):
        error = future.exception()
        rows[case] = failed(*case, error) if error else future.result()
        print(rows[case].line(), flush=True)
    ordered = [rows[name, seed] for name in strata for seed in args.seeds]
    print('\n' + table(ordered))
    write_rows(args.json, ordered)
    return 1 if any(row.verdict == 'FAILED' for row in ordered) else 0

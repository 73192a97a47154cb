"""`endoscope bench concealed`: what is said of rigs with something concealed that is drawn anew."""

import argparse
import json
import re
from pathlib import Path


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
    parser.add_argument(
        '--stratum', nargs='+', metavar='NAME', help='kinds of cases (default: all)'
    )
    parser.add_argument(
        '--seeds', type=seeds, default=range(1, 4), metavar='A-B', help='(default: 1-3)'
    )
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='cases side by side (1)')
    parser.add_argument('--json', type=Path, metavar='FILE', help='file for all rows')


def run(args: argparse.Namespace) -> int:
    """Print a line for each case, then the table; return 1 if a case failed."""
    from concurrent.futures import as_completed
    from dataclasses import asdict

    from endoscope_benchmarks.concealed.strata import STRATA
    from endoscope_benchmarks.concealed.trial import explained, failed, table
    from endoscope_core.atomic_output import write_text
    from endoscope_core.errors import EndoscopeError
    from endoscope_core.worker_pool import worker_pool

    strata = args.stratum or list(STRATA)
    for name in strata:
        if name not in STRATA:
            raise EndoscopeError(f"no stratum '{name}'; known are {', '.join(STRATA)}")
    cases = [(name, seed) for name in strata for seed in args.seeds]
    rows = {}
    with worker_pool(args.jobs) as pool:
        futures = {pool.submit(explained, *case): case for case in cases}
        for future in as_completed(futures):
            case, error = futures[future], future.exception()
            rows[case] = failed(*case, error) if error else future.result()
            print(rows[case].line(), flush=True)
    ordered = [rows[case] for case in cases]
    print('\n' + table(ordered))
    if args.json:
        write_text(args.json, json.dumps([asdict(row) for row in ordered], indent=1) + '\n')
    return 1 if any(row.verdict == 'FAILED' for row in ordered) else 0


def seeds(text: str) -> range:
    """Read a range of seeds, `A-B` with both ends, or one.

    Raises
    ------
    argparse.ArgumentTypeError
        If it is none.
    """
    found = re.fullmatch(r'(\d+)(?:-(\d+))?', text)
    if not found or int(found[2] or found[1]) < int(found[1]):
        raise argparse.ArgumentTypeError(f'{text!r} are no seeds: give 1-20, or 7')
    return range(int(found[1]), int(found[2] or found[1]) + 1)

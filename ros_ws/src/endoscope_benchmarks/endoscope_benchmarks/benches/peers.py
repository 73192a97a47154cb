"""`endoscope bench peers`: what other people's methods say of the rigs of `bench concealed`."""

import argparse
import json
from pathlib import Path

from endoscope_benchmarks.benches.concealed import seeds

STRATA = ('catalogue', 'mixed_forms', 'nulls')


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `peers`."""
    parser = subparsers.add_parser(
        'peers',
        help="other people's methods on rigs with something concealed",
        description="Runs every peer on an example of its authors', then on the cases that "
        '`endoscope bench concealed` draws, beside `endoscope explain`. Packages of peers are '
        'installed by `make -C ros_ws peers`. Exits 1 if a peer fails on its own example.',
    )
    parser.add_argument('--peer', nargs='+', metavar='NAME', help='(default: all)')
    parser.add_argument('--stratum', nargs='+', metavar='NAME', default=STRATA)
    parser.add_argument(
        '--seeds', type=seeds, default=range(1, 4), metavar='A-B', help='(default: 1-3)'
    )
    parser.add_argument('--jobs', type=int, default=1, metavar='N', help='cases side by side (1)')
    parser.add_argument('--json', type=Path, metavar='FILE', help='file for all answers')


def run(args: argparse.Namespace) -> int:
    """Print a line for each answer, then the table; return 1 if an own example fails."""
    from concurrent.futures import as_completed
    from dataclasses import asdict

    from endoscope_benchmarks.peers.trial import PEERS, answers, example, require, table, versions
    from endoscope_core.atomic_output import write_text
    from endoscope_core.worker_pool import worker_pool

    names = args.peer or list(PEERS)
    require(names, args.stratum)
    print(versions(names), flush=True)
    found, cases = [], [(stratum, seed) for stratum in args.stratum for seed in args.seeds]
    with worker_pool(args.jobs) as pool:
        shown = dict(zip(names, pool.map(example, names), strict=True))
        futures = [pool.submit(answers, names, *case) for case in cases]
        for future in as_completed(futures):
            found += future.result()
            print('\n'.join(answer.line() for answer in future.result()), flush=True)
    print('\n' + table(shown, found))
    if args.json:
        write_text(args.json, json.dumps([asdict(each) for each in found], indent=1) + '\n')
    return 0 if all(own.works for own in shown.values()) else 1

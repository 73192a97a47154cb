"""`endoscope bench files`: what the readers do with damaged and crafted files."""

import argparse
import sys

from endoscope_benchmarks.bench import add_jobs, add_only, require_known, table_head
from endoscope_bringup.subcommands import COUNT, seed


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `files`."""
    parser = subparsers.add_parser(
        'files',
        help='what the readers do with damaged and crafted files',
        description='Spoils files of each kind at random, by bytes and by their structure, reads '
        'them in processes of 2 GB and 60 s a file, and prints a table. Exits 1 where a file '
        'ended otherwise than in one line or a correct answer.',
    )
    parser.add_argument(
        '--cases', type=COUNT, default=300, metavar='N', help='files of each kind (300)'
    )
    parser.add_argument('--seed', type=seed, default=0, help='of the spoiling (0)')
    add_only(parser, 'kind')
    add_jobs(parser, default=2)


def run(args: argparse.Namespace) -> int:
    """Print a row for each kind; return 1 if a file did more than it may."""
    from endoscope_benchmarks.hostile_files.trial import KINDS, OUTCOMES, Outcomes, try_files

    require_known('kind', args.only or (), KINDS)
    print(table_head('kind', 'cases', *OUTCOMES, 'peak memory [MB]', 'longest [s]'))
    good = True
    for kind in args.only or KINDS:
        found = Outcomes(kind)
        for batch in try_files(kind, args.cases, args.seed, args.jobs):
            found.add(batch)
            done = f'\r{kind}: {found.counts.total()} of {args.cases}'
            print(done, end='', file=sys.stderr, flush=True)
        print(file=sys.stderr)
        print(found, flush=True)
        for number, what in found.bad:
            print(f'{kind} {number}: {what}', file=sys.stderr)
        good = good and found.good
    return 0 if good else 1

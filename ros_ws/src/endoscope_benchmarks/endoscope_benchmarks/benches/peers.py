"""`endoscope bench peers`: what other people's methods say of the rigs of `bench concealed`."""

import argparse

from endoscope_benchmarks.bench import (
    add_case_options,
    require_known,
    side_by_side,
    write_rows,
)

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
    add_case_options(parser, STRATA)


def run(args: argparse.Namespace) -> int:
    """Print a line for each answer, then the table; return 1 if an own example fails."""
    from endoscope_benchmarks.concealed.strata import STRATA as KNOWN
    from endoscope_benchmarks.peers.trial import (
        PEERS,
        answers,
        example,
        require_installed,
        table,
        versions,
    )
    from endoscope_core.workers import worker_pool

    names = args.peer or list(PEERS)
    require_known('peer', names, PEERS)
    require_known('stratum', args.stratum, KNOWN)
    require_installed(names)
    print(versions(names), flush=True)
    with worker_pool(args.jobs) as pool:
        shown = dict(zip(names, pool.map(example, names), strict=True))
    cases = [(names, name, seed) for name in args.stratum for seed in args.seeds]
    found = []
    for _, future in side_by_side(args.jobs, answers, cases):
        found += future.result()
        print('\n'.join(answer.line() for answer in future.result()), flush=True)
    print('\n' + table(shown, found))
    write_rows(args.json, found)
    return 0 if all(own.works for own in shown.values()) else 1

"""`endoscope bench recordings`: what is said of the simulated slave's own recordings."""

import argparse
import json
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_benchmarks.bench import (
    add_jobs,
    add_seeds,
    side_by_side,
    table_head,
    table_row,
)
from endoscope_bringup.subcommands import COUNT

if TYPE_CHECKING:
    from endoscope_benchmarks.own_recordings.trial import Row


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `recordings`."""
    parser = subparsers.add_parser(
        'recordings',
        help='explain recordings of the simulated slave with its own plant',
        description='Draws for every seed what somebody does with the graph while it is recorded, '
        'in lock-step or real time, cuts the recording anywhere, and explains it with the plant '
        'that was simulated: nothing is missing. Seeds from 1 to 99 are for development; of '
        'others, first runs are reported. What is done already in DIR is not done again.',
    )
    add_seeds(parser, 'of the recordings (1-3)')
    parser.add_argument('--n', type=COUNT, metavar='N', help='so many of them only')
    parser.add_argument(
        '--out', type=Path, default=Path('own_recordings'), metavar='DIR', help='for bags and rows'
    )
    add_jobs(parser)


def run(args: argparse.Namespace) -> int:
    """Print a line for each recording and a table; return 0."""
    from dataclasses import asdict

    from endoscope_benchmarks.own_recordings.trial import Row, recorded_and_explained
    from endoscope_core.atomic_output import write_text

    seeds = list(args.seeds)[: args.n]
    args.out.mkdir(parents=True, exist_ok=True)
    files = {seed: args.out / f'{seed}.json' for seed in seeds}
    rows = {
        seed: Row(**json.loads(file.read_text(encoding='utf-8')))
        for seed, file in files.items()
        if file.exists()
    }
    calls = [(seed, args.out) for seed in seeds if seed not in rows]
    for _, future in side_by_side(args.jobs, recorded_and_explained, calls):
        row = future.result()
        rows[row.seed] = row
        write_text(files[row.seed], json.dumps(asdict(row), indent=1) + '\n')
        print(f'{len(rows)} of {len(seeds)}: {_line(row)}', flush=True)
    _print_table([rows[seed] for seed in seeds])
    return 0


def _line(row: 'Row') -> str:
    return (
        f'seed {row.seed}, {row.way}; {row.length:.1f} s, load {row.load:.1f}: {row.sentence} '
        f'({row.seconds:.0f} s)'
    )


def _print_table(rows: list['Row']) -> None:
    verdicts = sorted({row.verdict for row in rows})
    print(table_head('made in', 'recordings', *verdicts, 'physics named'))
    for way in ('lock-step', 'real time', ''):
        of_way = [row for row in rows if row.way.startswith(way)]
        counts = [sum(row.verdict == verdict for row in of_way) for verdict in verdicts]
        named = sum(row.names_physics for row in of_way)
        print(table_row(way or 'all', len(of_way), *counts, named))

"""`endoscope bench pauses`: whether the slave obeys after a rest, or says that it does not."""

import argparse
import itertools
import math
from typing import TYPE_CHECKING

from endoscope_benchmarks.bench import (
    add_jobs,
    add_seeds,
    side_by_side,
    table_head,
    table_row,
)
from endoscope_bringup.subcommands import within

if TYPE_CHECKING:
    from endoscope_benchmarks.pauses import Row


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `pauses`."""
    parser = subparsers.add_parser(
        'pauses',
        help='rest within a motion session, then move',
        description='Draws for every seed a rest from 1 s to the longest, evenly on a logarithmic '
        'scale, and what is asked for after it: a way home, a played motion, the handle or a '
        'calibration. The simulated graph goes through it in lock-step; within 0.5 s of the first '
        'command the motors have to turn, or the graph has to say why they do not.',
    )
    add_seeds(parser, 'of the rests (1-3)')
    parser.add_argument(
        '--longest',
        type=within(1.0, 1e6, float),
        default=3600.0,
        metavar='S',
        help='longest rest in s (3600)',
    )
    add_jobs(parser)


def run(args: argparse.Namespace) -> int:
    """Print a line for each rest and a table; return 1 if the graph was silent after one."""
    from endoscope_benchmarks.pauses import rested_and_moved

    rows = []
    calls = [(seed, args.longest) for seed in args.seeds]
    for done, (_, future) in enumerate(side_by_side(args.jobs, rested_and_moved, calls), 1):
        row = future.result()
        rows.append(row)
        print(
            f'{done} of {len(calls)}: seed {row.seed}, {row.rest_s:.0f} s, then {row.asked}: '
            f'{row.became}, {row.within_s:.2f} s after the first command',
            flush=True,
        )
    return _print_table(rows)


def _print_table(rows: list['Row']) -> int:
    print(table_head('rest', 'rests', 'obeyed', 'refused and said', 'silent', 'latest [s]'))
    ends = (0.0, 10.0, 100.0, 1000.0, math.inf)
    bands = [*itertools.pairwise(ends), (0.0, math.inf)]
    for low, high in bands:
        of_band = [row for row in rows if low <= row.rest_s < high]
        obeyed = sum(row.became == 'obeyed' for row in of_band)
        silent = sum(row.became == 'silent' for row in of_band)
        latest = max((row.within_s for row in of_band), default=0.0)
        name = 'all' if (low, high) == bands[-1] else f'from {low:.0f} s'
        refused = len(of_band) - obeyed - silent
        print(table_row(name, len(of_band), obeyed, refused, silent, f'{latest:.2f}'))
    return int(any(row.became == 'silent' for row in rows))

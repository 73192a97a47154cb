"""`endoscope bench papers`: the tables of both papers, theirs beside ours."""

import argparse
import importlib
import sys
from pathlib import Path

from endoscope_benchmarks.bench import report
from endoscope_bringup.subcommands import COUNT, seed

TABLES = {
    'tension_by_shape': 'Table 1: RMSE of wire tension among shapes of like and of unlike '
    'hysteresis, N',
    'classifiers': 'First paper, table 3: class and backlash size from wire tensions',
    'nearest_class': 'Table 4: RMSE of the actual angle, class against colon shape, deg',
    'colon_shapes': 'Table 5: RMSE and backlash, none against compensated, deg',
    'compensators': 'RMSE left on tubes never seen in fitting, % of the uncompensated; signals '
    'scaled to 80 % of the bending range of the tube where that is less',
    'reach': 'Bending range told by the 9 s calibration, to both sides, % off the true one',
    'changing_tube': 'Second paper: RMSE left of 60 sin t, % of the uncompensated, the tube bent '
    'at 10 s',
    'calibration_time': 'Calibration, from request to compensated motion, s',
    'real_sizes': 'Real recordings: backlash size from tension alone',
    'real_recordings': 'Real recordings (five tubes): identified on the first cycle, judged on the '
    'second, deg rms',
}
"""Titles of the tables, in the order of printing; `papers` has a function `NAME_rows` for each."""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `papers`."""
    parser = subparsers.add_parser(
        'papers',
        help="the papers' tables beside ours",
        description='Measures what the two papers report, on tube configurations that nothing '
        'was fitted on, and prints it beside their figures. Exits 1 if an aim is missed.',
    )
    parser.add_argument('--seed', type=seed, default=1, help='chooses tubes, rigs and noise (1)')
    parser.add_argument(
        '--tubes', type=COUNT, default=5, metavar='N', help='tube configurations of each row (5)'
    )
    parser.add_argument(
        '--only',
        nargs='+',
        choices=tuple(TABLES),
        default=tuple(TABLES),
        metavar='TABLE',
        help=f'print these only (of {", ".join(TABLES)})',
    )
    parser.add_argument(
        '--plot',
        type=Path,
        metavar='FILE',
        help='only draw loops and tracking before and after compensation, as SVG',
    )


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0 if every aim is kept, else 1."""
    from endoscope_benchmarks.papers.row import PapersBench, table_text

    try:
        settings = PapersBench(args.seed, args.tubes, report)
    except ValueError as error:
        print(f'endoscope bench papers: {error}', file=sys.stderr)
        return 2
    if 'classifiers' in args.only and args.plot is None:
        # Says now rather than after the other tables what it needs.
        importlib.import_module('endoscope_benchmarks.networks')
    if args.plot is not None:
        from endoscope_benchmarks.papers.plot import tracking_plot
        from endoscope_core.atomic_output import write_text

        write_text(args.plot, tracking_plot(args.seed))
        return 0
    from endoscope_benchmarks.papers import classification, compensation

    missed = 0
    print(f'seed {settings.seed}, {settings.tubes} tube configurations a row', flush=True)
    for name in args.only:
        room = compensation if hasattr(compensation, f'{name}_rows') else classification
        rows = getattr(room, f'{name}_rows')(settings)
        missed += sum(row.reached is False for row in rows)
        print(f'\n{TABLES[name]}\n{table_text(rows)}', flush=True)
    return 1 if missed else 0

"""`endoscope demo`: the papers' whole procedure on the simulated slave, recorded, with report."""

import argparse
import time
from functools import partial
from pathlib import Path

from endoscope_bringup.subcommands import seed


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `demo`."""
    parser = subparsers.add_parser(
        'demo',
        help='the whole procedure on the simulated slave, recorded, with a report',
        description='Enables the simulated slave, calibrates it by its wire tensions, and tracks '
        "the first paper's signals uncompensated, by the first paper's method, and by the inverse "
        'of the plant that the calibration identified, without and with feedback; writes bags and '
        'report.html.',
    )
    parser.add_argument(
        '--out',
        type=Path,
        metavar='DIR',
        help='folder for bags and report, empty or not yet there; default bags/demo-DATE-TIME',
    )
    parser.add_argument('--seed', type=seed, default=1, help='of the noise; default %(default)s')
    parser.add_argument(
        '--tube',
        choices=('descending', 'transverse', 'both'),
        default='both',
        help="which of the first paper's two colon shapes; default %(default)s",
    )
    parser.add_argument(
        '--real-time',
        action='store_true',
        help='run by the wall clock instead of in lock-step on /clock',
    )


def run(args: argparse.Namespace) -> int:
    """Run the demonstration and return 0."""
    progress = partial(_print_progress, time.monotonic())
    # Before anything is imported that takes seconds.
    shapes = 'both shapes' if args.tube == 'both' else f'the {args.tube} shape'
    progress(f'calibrating and moving a simulated endoscope in {shapes} of the colon')
    from endoscope_bringup.demo.procedure import TUBES
    from endoscope_bringup.demo.report_page import headline
    from endoscope_bringup.demo.results import figures_table, table_rows
    from endoscope_bringup.demo.run_demo import REPORT, run_demo
    from endoscope_core.atomic_output import atomic_directory

    out = args.out or Path(time.strftime('bags/demo-%Y%m%d-%H%M%S'))
    tubes = [tube for tube in TUBES if args.tube == 'both' or tube.name.startswith(args.tube)]
    with atomic_directory(out) as folder:
        results = run_demo(
            folder, tubes=tubes, seed=args.seed, real_time=args.real_time, progress=progress
        )
    rows = table_rows(results)
    print(figures_table(rows))
    print(f'{headline(rows)}.')
    print(f'report and recordings: {out / REPORT}')
    return 0


def _print_progress(began: float, what: str) -> None:
    print(f'[{time.monotonic() - began:6.1f} s] {what}', flush=True)

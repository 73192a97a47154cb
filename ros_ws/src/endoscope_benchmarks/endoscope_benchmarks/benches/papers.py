"""`endoscope bench papers`: the tables of both papers, theirs beside ours."""

import argparse
import importlib
import sys
from pathlib import Path

from endoscope_benchmarks.benches.papers_tables import TABLES
from endoscope_bringup.subcommands import COUNT, seed


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
        choices=TABLES,
        default=TABLES,
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
    from endoscope_benchmarks.benches.papers_tables.row import PapersBench, table_text

    try:
        settings = PapersBench(args.seed, args.tubes, _report)
    except ValueError as error:
        print(f'endoscope bench papers: {error}', file=sys.stderr)
        return 2
    if 'classifiers' in args.only and args.plot is None:
        # Says now rather than after the other tables what it needs.
        importlib.import_module('endoscope_benchmarks.networks.papers_recipe')
    if args.plot is not None:
        from endoscope_benchmarks.benches.papers_plot import tracking_plot
        from endoscope_core.atomic_output import write_text

        write_text(args.plot, tracking_plot(args.seed))
        return 0
    missed = 0
    print(f'seed {settings.seed}, {settings.tubes} tube configurations a row', flush=True)
    for name in args.only:
        module = importlib.import_module(f'endoscope_benchmarks.benches.papers_tables.{name}')
        rows = module.rows(settings)
        missed += sum(row.reached is False for row in rows)
        print(f'\n{module.TITLE}\n{table_text(rows)}', flush=True)
    return 1 if missed else 0


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)

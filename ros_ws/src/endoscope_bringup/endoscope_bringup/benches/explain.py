"""`endoscope bench explain`: how often an explanation is right, on concealed cases."""

import argparse
from pathlib import Path

from endoscope_bringup.seed_argument import seed


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `explain`."""
    parser = subparsers.add_parser(
        'explain',
        help='how often an explanation is right, on concealed cases',
        description='Draws cases from a generator that shares no code with the plant, seals what '
        'was concealed, explains every case, and prints how often that was right, beside '
        'pysindy, pyoperon and forward selection. Exits 1 if a figure is missed.',
    )
    parser.add_argument('--cases', type=int, default=20, metavar='N', help='number of cases (20)')
    parser.add_argument('--seed', type=seed, default=1, metavar='S', help='chooses the cases (1)')
    parser.add_argument('--jobs', type=int, default=2, metavar='N', help='processes (2)')
    parser.add_argument('--no-peers', action='store_true', help='leave out the peers')
    parser.add_argument(
        '--keep',
        type=Path,
        metavar='FILE',
        help='append each outcome to FILE as JSON, and skip cases that are there',
    )


def run(args: argparse.Namespace) -> int:
    """Run and print; return 0 if every figure is reached, else 1."""
    from endoscope_bringup.benches.explain_speed import measure_speed
    from endoscope_explain.benchmark.figures_of_merit import figures
    from endoscope_explain.benchmark.kept_outcomes import run_and_keep
    from endoscope_explain.benchmark.printing import (
        calibration_table,
        confusion_table,
        peers_table,
        table,
    )

    speed = measure_speed(args.seed, args.jobs)
    outcomes = run_and_keep(args.cases, args.seed, args.jobs, not args.no_peers, args.keep)
    found = [*figures(outcomes), *speed]
    print(f'\n{len(outcomes)} cases, seed {args.seed}\n\n{table(found)}')
    print(f'\nnamed first, by what was concealed\n{confusion_table(outcomes)}')
    print(f'\ncalibration\n{calibration_table(outcomes)}')
    if not args.no_peers:
        print(f'\npeers, single effect, commissioning motion\n{peers_table(outcomes)}')
    return 1 if any(figure.reached is False for figure in found) else 0

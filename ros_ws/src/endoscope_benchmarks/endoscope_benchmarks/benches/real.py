"""`endoscope bench real`: one physics for real recordings of a flexible endoscope."""

import argparse
from pathlib import Path

from endoscope_benchmarks.bench import add_jobs, report

PAGE = 'real.html'


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `real`."""
    parser = subparsers.add_parser(
        'real',
        help='explain real recordings of a flexible endoscope by one physics',
        description='Fits five tubes together on their first cycle and searches what they lack, '
        'predicts the second cycles, and carries what was found to the rig in other states. The '
        'recordings are no part of this project: optimization/selected and '
        'operation/optimizer_input of nhoyh/hysteresis_compensation_ROS, in one folder.',
    )
    parser.add_argument('folder', type=Path, help='folder of the recordings')
    parser.add_argument(
        '--out', type=Path, default=Path(PAGE), metavar='FILE', help=f'page to write ({PAGE})'
    )
    parser.add_argument(
        '--taken-out',
        action='store_true',
        help='take each piece of the nominal physics out of each tube in turn instead, and look '
        'for it; prints a table',
    )
    add_jobs(parser)


def run(args: argparse.Namespace) -> int:
    """Print the tables and write the page."""
    from threadpoolctl import threadpool_limits

    from endoscope_benchmarks.real.explained import (
        explained_state,
        explained_tubes,
        numbers,
        unknown_tubes,
    )
    from endoscope_benchmarks.real.tables import as_text, page, sections
    from endoscope_benchmarks.real.taken_out import as_table, taken_out
    from endoscope_benchmarks.real.takes import require_recordings
    from endoscope_benchmarks.trials.real_recordings import (
        models_on_real_recordings,
        real_recordings,
    )
    from endoscope_core.atomic_output import write_text

    require_recordings(args.folder)
    # A fit's matrices are tall and narrow: threads would only wait for each other.
    with threadpool_limits(1, 'blas'):
        if args.taken_out:
            print(as_table(taken_out(args.folder, args.jobs, report)))
            return 0
        tubes = explained_tubes(args.folder, args.jobs, report)
        state = explained_state(args.folder, tubes, args.jobs, report)
        unknown = unknown_tubes(args.folder, tubes, report)
        box = models_on_real_recordings(real_recordings(args.folder), 'prandtl_ishlinskii', 0)
        parts = sections(
            tubes,
            numbers(tubes.explained, args.jobs),
            {str(bend): second for bend, (_, second) in box.items()},
            state,
            numbers([state.fit], args.jobs),
            unknown,
        )
    print(as_text(parts))
    write_text(args.out, page(parts))
    print(f'\nPage: {args.out}')
    return 0

"""`endoscope dataset`: simulated calibrations of known backlash size."""

import argparse
from pathlib import Path

from endoscope_bringup.subcommands import seed
from endoscope_core.errors import InputError


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `dataset`."""
    parser = subparsers.add_parser(
        'dataset',
        help='simulate calibration recordings of known backlash size',
        description='Writes recordings.npz and manifest.json to DIR: simulated calibrations of '
        'one or many random instruments in random tubes, in seven classes of backlash size from '
        '40 to 100 deg.',
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='DIR', help='new or empty folder'
    )
    parser.add_argument('--seed', type=seed, default=7, help='seed of the data set (7)')
    parser.add_argument(
        '--n',
        type=int,
        default=210,
        metavar='N',
        help='number of recordings, the same for each of the seven classes (210)',
    )
    parser.add_argument(
        '--instruments',
        choices=('one', 'many'),
        default='many',
        help='one: the same instrument in every tube; many: a new one in each (many)',
    )
    parser.add_argument(
        '--reset-pretension',
        action='store_true',
        help='set the pretension of the one instrument again before each recording',
    )
    parser.add_argument(
        '--motion',
        default='sinusoid',
        help="calibration motion: the first paper's sinusoid of 9 s, or brief (sinusoid)",
    )


def run(args: argparse.Namespace) -> int:
    """Make and write the data set; return 0."""
    from endoscope_core.atomic_output import require_free_directory
    from endoscope_lab.dataset import CLASSES_DEG, make_dataset, save_dataset

    require_free_directory(args.out)
    classes = len(CLASSES_DEG)
    if args.n < classes or args.n % classes:
        raise InputError(f'--n {args.n}: give a multiple of {classes}, the number of classes')
    dataset = make_dataset(
        args.seed,
        args.n // classes,
        _print_progress,
        args.motion,
        one_instrument=args.instruments == 'one',
        reset_pretension=args.reset_pretension,
    )
    save_dataset(dataset, args.out)
    print(
        f'{args.out}: {len(dataset.class_deg)} recordings, manifest SHA-256 {dataset.manifest_hash}'
    )
    return 0


def _print_progress(done: int, total: int) -> None:
    if done % 30 == 0 or done == total:
        print(f'{done} of {total} recordings', flush=True)

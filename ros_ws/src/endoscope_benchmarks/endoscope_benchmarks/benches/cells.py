"""`endoscope bench cells`: how a calibration fares with load cells as they are."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import COUNT, seed

if TYPE_CHECKING:
    from endoscope_benchmarks.trials.disturbed_cells import Outcome

_PERIODS_MS = (1, 5, 10)
_ZEROS_N = (0.02, 0.05, 0.1, 0.2, 0.5)
_GAINS = (0.01, 0.03, 0.1)
_OUTSIDE_DEG = (30.0, 120.0)


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `cells`."""
    parser = subparsers.add_parser(
        'cells',
        help='how a calibration fares with load cells as they are',
        description='Calibrates instruments that nothing was trained on, with good cells at '
        '1000, 200 and 100 Hz, with errors of zero and gain, with cells that drift, clip, stick, '
        'are slow, exchanged or unplugged, and in tubes of 30 and 120 deg: right, wrong, refused.',
    )
    parser.add_argument('--seed', type=seed, default=1, help='chooses rigs, tubes and noise (1)')
    parser.add_argument('--tubes', type=COUNT, default=20, metavar='N', help='tubes a class (20)')
    parser.add_argument(
        '--motion', default='sinusoid', help='calibration motion: sinusoid or brief (sinusoid)'
    )
    parser.add_argument(
        '--weights', type=Path, metavar='FILE', help='from `endoscope train` (those of the product)'
    )


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0."""
    from endoscope_benchmarks.trials.disturbed_cells import (
        FAULTS,
        outcome,
        tubes_of_sizes,
        tubes_outside,
    )
    from endoscope_core.classifier.weights_file import load_classifier
    from endoscope_core.dataset import CLASSES_DEG

    classifier = load_classifier(args.weights, args.motion)
    tubes = tubes_of_sizes(args.seed, CLASSES_DEG, args.tubes, args.motion)
    print(f'{args.motion}, seed {args.seed}, {len(tubes.size)} tubes')
    print('cells                                 right   wrong  refused  size: rms    90 % holds')
    cases: dict[str, dict] = {
        f'good, read at {1000 // period} Hz': {'period': period} for period in _PERIODS_MS
    }
    cases |= {f'zero errors of {zero} N (sd)': {'zero': zero} for zero in _ZEROS_N}
    cases |= {f'gain errors of {100 * gain:.0f} % (sd)': {'gain': gain} for gain in _GAINS}
    cases |= {
        f'0.1 N and 3 %, read at {1000 // period} Hz': {'period': period, 'zero': 0.1, 'gain': 0.03}
        for period in _PERIODS_MS
    }
    cases |= {fault: {'fault': fault} for fault in FAULTS}
    for name, case in cases.items():
        _print(name, outcome(classifier, tubes, args.seed, **case))
    for size in _OUTSIDE_DEG:
        outside = tubes_outside(args.seed, size, args.tubes, args.motion)
        _print(f'good, tubes of {size:.0f} deg', outcome(classifier, outside, args.seed))
    return 0


def _print(name: str, found: 'Outcome') -> None:
    import numpy as np

    shares = [100.0 * share for share in (found.right, found.wrong, found.refused)]
    rmse, holds = np.rad2deg(found.rmse), 100.0 * found.holds
    line = f'{name:36s} {shares[0]:5.1f} % {shares[1]:5.1f} % {shares[2]:6.1f} %  '
    told = '     -           -' if np.isnan(rmse) else f'{rmse:6.2f} deg  {holds:6.1f} %'
    print(line + told, flush=True)

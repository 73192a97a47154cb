"""`endoscope train`: the classifier of wire tensions, from simulated rigs."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import COUNT, seed
from endoscope_core.errors import FileError

if TYPE_CHECKING:
    import numpy as np


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `train`."""
    parser = subparsers.add_parser(
        'train',
        help='train the tension classifier',
        description="Simulates calibrations of random rigs, trains the first paper's 1D-CNN on "
        'them, calibrates its intervals and refusals on other rigs, and writes FILE and a JSON '
        'file of the same name that describes the training. An interrupted training resumes from '
        'FILE.part with the same command. Needs PyTorch: `make -C ros_ws train` installs it.',
    )
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='FILE',
        help='weights to write, usually with suffix .safetensors',
    )
    parser.add_argument(
        '--motion',
        default='sinusoid',
        help="calibration motion: the first paper's sinusoid of 9 s, or brief (sinusoid)",
    )
    parser.add_argument(
        '--seed', type=seed, default=0, help='seed of rigs, weights and batches (0)'
    )
    parser.add_argument(
        '--n', type=COUNT, default=5000, metavar='N', help='rigs for training (5000)'
    )
    parser.add_argument(
        '--steps',
        type=COUNT,
        default=6000,
        metavar='N',
        help='training steps of 64 recordings (6000)',
    )


def run(args: argparse.Namespace) -> int:
    """Train and write; return 0."""
    from endoscope_core.signals import calibration_motion

    out = Path(args.out)
    if out.suffix == '.json' or out.is_dir():
        raise FileError(f'{out} cannot hold weights: name a file with suffix .safetensors')
    calibration_motion(args.motion)
    from endoscope_lab.training.cnn_training import CnnTraining, description_of, train_cnn

    settings = CnnTraining.of_size(args.n, args.steps)
    kept = out.with_name(f'{out.name}.part')
    trained = train_cnn(args.motion, args.seed, settings, kept, _print_line)
    command = (
        f'endoscope train --motion {args.motion} --seed {args.seed} --n {args.n} '
        f'--steps {args.steps} --out {out.name}'
    )
    described = description_of(trained, settings, args.seed, command)
    _save_weights(out, trained.classifier.weights, described)
    kept.unlink(missing_ok=True)
    for rate, figures in trained.held_out.items():
        print(
            f'{out}: rigs held out, read at {rate}: nearest class right in '
            f'{100.0 * figures["nearest_class_right"]:.1f} %, {figures["size_rmse_deg"]:.2f} deg '
            f'rms, {100.0 * figures["intervals_hold"]:.0f} % of sizes in their interval, '
            f'{100.0 * figures["refused"]:.1f} % refused'
        )
    return 0


def _print_line(line: str) -> None:
    print(line, flush=True)


def _save_weights(
    path: Path, state: Mapping[str, 'np.ndarray'], description: Mapping[str, object]
) -> None:
    """Write arrays, and their description to the JSON file of the same name beside them."""
    import json

    import numpy as np
    import safetensors.numpy

    from endoscope_core.atomic_output import atomic_file, write_text
    from endoscope_core.classifier.cnn_classifier import SCHEMA, sealed

    described = {'schema': SCHEMA, 'kind': 'cnn', **description}
    data = safetensors.numpy.save({k: np.asarray(x, order='C') for k, x in state.items()})
    with atomic_file(path) as partial:
        partial.write_bytes(data)
    write_text(path.with_suffix('.json'), json.dumps(sealed(described, data), indent=1) + '\n')

"""`endoscope train`: a classifier of wire tensions from a data set."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.seed_argument import seed

if TYPE_CHECKING:
    from endoscope_core.dataset import CalibrationDataset


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `train`."""
    parser = subparsers.add_parser(
        'train',
        help='train the tension classifier',
        description='Cross-validates a classifier with held-out tube configurations, trains it on '
        'all of DIR, and writes FILE and a JSON file of the same name that says how.',
    )
    parser.add_argument(
        '--data', type=Path, required=True, metavar='DIR', help='data set of `endoscope dataset`'
    )
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='FILE',
        help='weights to write, by custom with suffix .safetensors',
    )
    parser.add_argument(
        '--model',
        choices=('size', 'cnn'),
        default='size',
        help='size: regresses the backlash size with an interval, and refuses what it does not '
        "know; cnn: the first paper's 1D-CNN, for the sinusoid only, which needs PyTorch: "
        '`make -C ros_ws train` installs it (size)',
    )
    parser.add_argument('--seed', type=seed, default=0, help='of weights, batches and folds (0)')
    parser.add_argument(
        '--folds', type=int, default=5, metavar='K', help='of the cross-validation (5)'
    )
    parser.add_argument(
        '--plots',
        type=Path,
        metavar='DIR',
        help='new folder for SVG plots of what held-out tubes say: classes confused, and with '
        'size the calibration of its intervals',
    )


def run(args: argparse.Namespace) -> int:
    """Validate, train and write; return 0."""
    from endoscope_core.atomic_output import require_free_directory
    from endoscope_core.classifier.weights_file import weights_path
    from endoscope_core.dataset import load_dataset

    out = weights_path(args.out)
    if args.plots is not None:
        require_free_directory(args.plots)
    dataset = load_dataset(args.data)
    made = dataset.manifest
    command = (
        f'endoscope dataset --seed {made["seed"]} --n {len(dataset.class_deg)} '
        f'--motion {dataset.motion} --out DATA && endoscope train --model {args.model} '
        f'--seed {args.seed} --folds {args.folds} --data DATA --out {out.name}'
    )
    if args.model == 'cnn':
        line = _train_cnn(args, dataset, out, command)
    else:
        line = _train_size(args, dataset, out, command)
    print(f'{out}: {line} on held-out tube configurations')
    return 0


def _train_cnn(
    args: argparse.Namespace, dataset: 'CalibrationDataset', out: Path, command: str
) -> str:
    from endoscope_core.classifier.training import (
        cross_validate,
        save_network,
        train_network,
        use_one_thread,
    )

    use_one_thread()
    validation = cross_validate(dataset, args.seed, args.folds, _print_line)
    network = train_network(dataset.tension, dataset.class_deg, args.seed)
    save_network(out, network, dataset, validation, command, args.seed)
    if args.plots is not None:
        from endoscope_bringup.learning.classifier_figures import confusion_figure, save_figures

        save_figures(args.plots, {'confusion': confusion_figure(validation, '1D-CNN')})
    return f'{100.0 * validation.mean_accuracy:.2f} % right'


def _train_size(
    args: argparse.Namespace, dataset: 'CalibrationDataset', out: Path, command: str
) -> str:
    import math

    from endoscope_core.classifier.size_training import (
        save_size_classifier,
        validated_size_classifier,
    )

    classifier, validation = validated_size_classifier(dataset, args.seed, args.folds, _print_line)
    save_size_classifier(out, classifier, dataset, validation, command, args.seed)
    if args.plots is not None:
        from endoscope_bringup.learning.classifier_figures import (
            confusion_figure,
            intervals_figure,
            save_figures,
        )

        figures = {
            'confusion': confusion_figure(validation.classes, 'by backlash size'),
            'intervals': intervals_figure(validation, dataset.backlash_size),
        }
        save_figures(args.plots, figures)
    coverage = 100.0 * sum(validation.coverage) / len(validation.coverage)
    rmse = math.sqrt(sum(x * x for x in validation.rmse) / len(validation.rmse))
    return (
        f'{100.0 * validation.classes.mean_accuracy:.2f} % right, {math.degrees(rmse):.2f} deg rms '
        f'with {coverage:.0f} % of sizes in their interval,'
    )


def _print_line(line: str) -> None:
    print(line, flush=True)

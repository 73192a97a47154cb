"""`endoscope train`: the tension classifier of the first paper from a data set."""

import argparse
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `train`."""
    parser = subparsers.add_parser(
        'train',
        help='train the tension classifier',
        description='Cross-validates the 1D-CNN with held-out tube configurations, trains it on '
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
        help='weights to write, by custom with suffix .pt',
    )
    parser.add_argument('--seed', type=int, default=0, help='of weights, batches and folds (0)')
    parser.add_argument(
        '--folds', type=int, default=5, metavar='K', help='of the cross-validation (5)'
    )


def run(args: argparse.Namespace) -> int:
    """Validate, train and write; return 0."""
    from endoscope_core.classifier.training import cross_validate, train_network, use_one_thread
    from endoscope_core.classifier.weights_file import save_classifier, weights_path
    from endoscope_core.dataset import load_dataset

    out = weights_path(args.out)
    dataset = load_dataset(args.data)
    use_one_thread()
    validation = cross_validate(dataset, args.seed, args.folds, _print_line)
    network = train_network(dataset.tension, dataset.class_deg, args.seed)
    made = dataset.manifest
    command = (
        f'endoscope dataset --seed {made["seed"]} --per-class {made["per_class"]} '
        f'--out DATA && endoscope train --seed {args.seed} --folds {args.folds} '
        f'--data DATA --out {out.name}'
    )
    save_classifier(out, network, dataset, validation, command, args.seed)
    print(f'{out}: {100.0 * validation.mean_accuracy:.2f} % right on held-out tube configurations')
    return 0


def _print_line(line: str) -> None:
    print(line, flush=True)

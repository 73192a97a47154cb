"""`endoscope fit`: parameter sets from a data set, and a rig from recordings of its tubes."""

import argparse
import sys
from pathlib import Path

from endoscope_bringup.commands.identify import MODELS
from endoscope_bringup.subcommands import COUNT, seed


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `fit` with `classes` and `family`."""
    parser = subparsers.add_parser(
        'fit', help='fit parameters of each class to a data set, or a rig to its tubes'
    )
    kinds = parser.add_subparsers(dest='fit', metavar='WHAT', required=True)
    classes = kinds.add_parser(
        'classes',
        help='a parameter set for each class of a data set',
        description='Fits a hysteresis model and its feed-forward to each class of a data set of '
        '`endoscope dataset`; writes JSON.',
    )
    classes.add_argument(
        'source', type=Path, metavar='DATASET', help='data set of `endoscope dataset`'
    )
    classes.add_argument('--model', choices=MODELS, required=True, help='hysteresis model')
    classes.add_argument(
        '--per-class',
        type=COUNT,
        default=30,
        metavar='N',
        help='recordings per class, at most (30)',
    )
    classes.add_argument('--out', type=Path, required=True, metavar='FILE', help='JSON to write')
    family = kinds.add_parser(
        'family',
        help='a rig, from recordings in all its tubes',
        description='Identifies a rig from recordings in all its tubes (text files 0.txt, 60.txt, '
        '... named by the bend in deg). Fits 1.3 cycles of each, validates on the rest, and '
        'compares with friction lumped at the ends.',
    )
    family.add_argument('source', type=Path, metavar='FOLDER', help='recordings of tubes')
    family.add_argument('--out', type=Path, metavar='FILE', help='YAML file for the parameters')
    for each in (classes, family):
        each.add_argument('--seed', type=seed, default=0, help='seed of the search (0)')


def run(args: argparse.Namespace) -> int:
    """Fit and write; return 0."""
    from endoscope_core.atomic_output import require_place

    if args.out is not None:
        require_place(args.out)
    return _family(args) if args.fit == 'family' else _classes(args)


def _family(args: argparse.Namespace) -> int:
    from endoscope_lab.identification.family_fit import tube_recordings
    from endoscope_lab.identification.family_of_recordings import identified, table

    recordings = tube_recordings(args.source)
    options = '' if args.out is None else f' --out {args.out.name}'
    command = f'endoscope fit family {args.source.name}{options} --seed {args.seed}'
    found = identified(recordings, args.seed, command, _report)
    print(table(recordings, found))
    if args.out is not None:
        found.family.save(args.out)
        _report(f'{args.out}: written')
    return 0


def _classes(args: argparse.Namespace) -> int:
    import json

    from endoscope_core.atomic_output import write_text
    from endoscope_core.control import FeedforwardSettings
    from endoscope_lab.dataset import load_dataset
    from endoscope_lab.identification.classes import class_parameter_sets, identify_classes

    dataset = load_dataset(args.source)
    lead = FeedforwardSettings.lead
    found = identify_classes(dataset, lead, args.seed, args.per_class, _report, args.model)
    command = (
        f'endoscope dataset --seed {dataset.manifest["seed"]} --n {len(dataset.class_deg)} '
        f'--out DATA && endoscope fit classes DATA --model {args.model} --seed {args.seed} '
        f'--per-class {args.per_class} --out {args.out.name}'
    )
    sets = class_parameter_sets(found, command, dataset.manifest_hash, lead, args.model)
    write_text(args.out, json.dumps(sets, indent=1) + '\n')
    _report(f'{args.out}: written')
    return 0


def _report(line: str) -> None:
    print(line, file=sys.stderr, flush=True)

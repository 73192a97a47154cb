"""`endoscope simulate`: the plant's answer to the commands of a bag."""

import argparse
import sys
from pathlib import Path

from endoscope_bringup.subcommands import add_options, seed
from endoscope_explain.options import Options

WORTH_SAYING = 0.02
"""Largest error of a formula's table without a warning, as a share of the formula's range."""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `simulate`."""
    parser = subparsers.add_parser(
        'simulate',
        help="write the plant's answer to the commands of a bag",
        description="Writes the plant's answer to the commands of BAG: the same topics at the same "
        'stamps, without noise unless --noise is given.',
    )
    parser.add_argument(
        '--plant', type=Path, required=True, metavar='P.yaml', help='the plant, with its effects'
    )
    parser.add_argument(
        '--commands',
        type=Path,
        required=True,
        metavar='BAG',
        help='rosbag2 folder or .mcap with motor/servo_jp or slave/servo_jp',
    )
    parser.add_argument(
        '--out',
        type=Path,
        required=True,
        metavar='BAG2',
        help='where to write: a bare file if it ends in .mcap, else a folder',
    )
    add_options(parser, Options, 'rig')
    parser.add_argument(
        '--noise',
        type=seed,
        metavar='SEED',
        help="add the sensors' noise and resolution, reproducibly",
    )


def run(args: argparse.Namespace) -> int:
    """Simulate and write; return 0."""
    from endoscope_bags import open_bag
    from endoscope_core.physics import load_plant
    from endoscope_core.physics.functions.term import tabulated
    from endoscope_core.rig import load_rig
    from endoscope_explain.answer_bag import write_answer

    plant = load_plant(args.plant)
    for term in plant.terms:
        lost = tabulated(term).largest_error
        if lost > WORTH_SAYING:
            print(
                f'unknown_term at {term.place} on {term.joint}: the table of its formula is off by '
                f'up to {100.0 * lost:.0f} % of what it spans; a narrower range is finer',
                file=sys.stderr,
            )
    rig = None if args.rig is None else load_rig(args.rig)
    count = write_answer(plant, open_bag(args.commands), args.out, args.noise, rig)
    print(f'{args.out}: {count} messages')
    return 0

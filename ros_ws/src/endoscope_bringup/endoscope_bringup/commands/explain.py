"""`endoscope explain`: where simulation and recording differ, what was left out, and the proof."""

import argparse
import sys
from functools import partial
from pathlib import Path

from endoscope_bringup.progress_line import ProgressLine
from endoscope_bringup.subcommands import COUNT, add_json_option, print_json, within
from endoscope_core.choices import WAIVABLE
from endoscope_core.errors import EndoscopeError

STEPS = 6
"""Of every explanation, beside one for each joint: read, refit, judge, locate, answer, compare."""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `explain`."""
    parser = subparsers.add_parser(
        'explain',
        help='find where a recording and its simulation differ, and which physics is missing',
        description='Explains what the simulation P.yaml leaves out of each recording BAG. Writes '
        'report.json, report.html and the improved plant, plant.yaml, to DIR; with several bags to '
        'one folder each in DIR, and a summary table.',
    )
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG', help='rosbag2 folder or .mcap')
    parser.add_argument(
        '--plant',
        type=Path,
        required=True,
        metavar='P.yaml',
        help='plant of the simulation to compare',
    )
    parser.add_argument(
        '--rig',
        type=Path,
        metavar='rig.yaml',
        help='rig file, if the bag contains none (default: the shipped rig)',
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='DIR', help='a new or empty folder'
    )
    parser.add_argument(
        '--baseline',
        type=Path,
        metavar='BAG0',
        help='healthy recording of the same rig: only what is new is explained',
    )
    parser.add_argument(
        '--validate',
        action='append',
        type=Path,
        metavar='BAG2',
        help='second recording of the same rig for validation; give it once for all bags or once '
        'for each',
    )
    parser.add_argument(
        '--without',
        action='append',
        default=[],
        metavar='TOPIC',
        choices=WAIVABLE,
        help='a topic that may be missing',
    )
    parser.add_argument(
        '--namespace', metavar='NS', help="namespace of the rig's topics, if a bag has several rigs"
    )
    parser.add_argument(
        '--band',
        type=within(1e-6, 100.0, float),
        default=0.15,
        metavar='SHARE',
        help="prior tolerance of the plant's parameters, as a share: 3 for a rig that was never "
        'identified (default 0.15)',
    )
    parser.add_argument(
        '--effects',
        type=COUNT,
        default=2,
        metavar='N',
        help='largest number of effects of a joint: 4 for a rig that the plant never matched '
        '(default 2)',
    )
    parser.add_argument(
        '--same-physics',
        action='store_true',
        help='all bags are of one rig, in other shapes or at other times: choose effects for all '
        'of them together',
    )
    parser.add_argument(
        '--jobs', type=COUNT, default=2, metavar='N', help='parallel tasks (default 2)'
    )
    parser.add_argument('--quick', action='store_true', help='do not design a next experiment')
    add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Explain and write; return 0."""
    from endoscope_core.physics import load_plant
    from endoscope_core.rig import load_rig
    from endoscope_explain.many_bags import explain_bags, summary
    from endoscope_explain.pipeline import Sources

    plant = load_plant(args.plant)
    rig = None if args.rig is None else load_rig(args.rig)
    sources = [
        Sources(
            bag,
            plant,
            baseline=args.baseline,
            validate=second,
            without=tuple(args.without),
            quick=args.quick,
            band=args.band,
            most_effects=args.effects,
            namespace=args.namespace,
            rig=rig,
            plant_file=args.plant,
            command=args.command_line,
        )
        for bag, second in zip(args.bags, _seconds(args), strict=True)
    ]
    with ProgressLine(STEPS + len(plant.joints), 'reading') as progress:
        found = explain_bags(
            sources,
            args.out,
            jobs=args.jobs,
            same_physics=args.same_physics,
            # What is printed is then one document; all else goes beside it.
            say=partial(progress.print, file=sys.stderr if args.json else sys.stdout),
            progress=progress.step,
        )
    if args.json:
        print_json([summary(name, content) for name, content in found.items()])
    return 0


def _seconds(args: argparse.Namespace) -> list[Path | None]:
    """The second recording of each bag."""
    given: list[Path | None] = list(args.validate or [None])
    if len(given) == 1:
        return given * len(args.bags)
    if len(given) != len(args.bags):
        raise EndoscopeError(
            f'--validate was given {len(given)} times for {len(args.bags)} bags: '
            'give it once, or once for each'
        )
    return given

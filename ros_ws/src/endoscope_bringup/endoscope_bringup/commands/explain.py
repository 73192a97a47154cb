"""`endoscope explain`: where simulation and recording differ, what was left out, and the proof."""

import argparse
import sys
from dataclasses import fields
from functools import partial
from pathlib import Path

from endoscope_bringup.progress_line import ProgressLine
from endoscope_bringup.subcommands import add_json_option, add_options, print_json
from endoscope_core.errors import EndoscopeError
from endoscope_explain.options import Options

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
        '--out', type=Path, required=True, metavar='DIR', help='a new or empty folder'
    )
    add_options(parser, Options)
    add_json_option(parser)


def run(args: argparse.Namespace) -> int:
    """Explain and write; return 0."""
    from endoscope_core.physics import load_plant
    from endoscope_core.rig import load_rig
    from endoscope_explain.case import Sources
    from endoscope_explain.many_bags import explain_bags, summary

    plant = load_plant(args.plant)
    given = {each.name: getattr(args, each.name) for each in fields(Options)}
    given |= {'rig': args.rig and load_rig(args.rig), 'plant_file': args.plant}
    given['command'] = args.command_line
    sources = [
        Sources(bag, plant, **given | {'validate': second})
        for bag, second in zip(args.bags, _seconds(args), strict=True)
    ]
    with ProgressLine(STEPS + len(plant.joints), 'reading') as progress:
        found = explain_bags(
            sources,
            args.out,
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

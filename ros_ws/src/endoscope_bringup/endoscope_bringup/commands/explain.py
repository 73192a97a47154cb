"""`endoscope explain`: where simulation and recording differ, what was left out, and the proof."""

import argparse
from pathlib import Path


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `explain`."""
    parser = subparsers.add_parser(
        'explain',
        help='say where a recording and its simulation differ, and what was left out',
        description='Explains what the simulation P.yaml leaves out of each recording BAG. Writes '
        'report.json, report.html and the improved plant.yaml to DIR; with several bags to '
        'one folder each in DIR, and a summary table.',
    )
    parser.add_argument('bags', nargs='+', type=Path, metavar='BAG', help='rosbag2 folder or .mcap')
    parser.add_argument(
        '--plant',
        type=Path,
        required=True,
        metavar='P.yaml',
        help='the simulation that is to be compared',
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='DIR', help='a new or empty folder'
    )
    parser.add_argument(
        '--baseline',
        type=Path,
        metavar='BAG0',
        help='the same rig when it was well: only what is new is explained',
    )
    parser.add_argument(
        '--validate',
        type=Path,
        metavar='BAG2',
        help='a second recording of the same rig to judge the fit on',
    )
    parser.add_argument(
        '--without',
        action='append',
        default=[],
        metavar='TOPIC',
        choices=['motor/measured_js'],
        help='a topic that may be missing',
    )
    parser.add_argument(
        '--band',
        type=_positive_share,
        default=0.15,
        metavar='SHARE',
        help="by which share the plant's parameters may differ from the rig's: 3 for a rig that "
        'was never identified (default 0.15)',
    )
    parser.add_argument(
        '--effects',
        type=_positive,
        default=2,
        metavar='N',
        help='how many effects to look for on a joint at most: 4 for a rig that the plant never '
        'matched (default 2)',
    )
    parser.add_argument(
        '--jobs', type=_positive, default=2, metavar='N', help='processes side by side (default 2)'
    )
    parser.add_argument(
        '--quick', action='store_true', help='leave out the black boxes and the next experiment'
    )
    parser.add_argument(
        '--dask',
        metavar='ADDRESS',
        help='explain several bags on the Dask cluster whose scheduler is there',
    )


def run(args: argparse.Namespace) -> int:
    """Explain and write; return 0."""
    from endoscope_core.plant import load_plant
    from endoscope_explain.many_bags import explain_bags
    from endoscope_explain.pipeline import Sources

    plant = load_plant(args.plant)
    sources = [
        Sources(
            bag,
            plant,
            args.baseline,
            args.validate,
            tuple(args.without),
            args.quick,
            args.band,
            args.effects,
        )
        for bag in args.bags
    ]
    explain_bags(sources, args.out, jobs=args.jobs, dask_address=args.dask)
    return 0


def _positive_share(text: str) -> float:
    share = float(text)
    if not 0.0 < share <= 100.0:
        raise argparse.ArgumentTypeError(f'{text} is not between 0 and 100')
    return share


def _positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f'{number} is not positive')
    return number

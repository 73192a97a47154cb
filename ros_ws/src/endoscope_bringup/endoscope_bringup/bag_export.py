"""`endoscope bag export`: recordings as a data set of robot learning."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import COUNT, add_json_option, print_json, within
from endoscope_core.choices import WAIVABLE

if TYPE_CHECKING:
    from endoscope_bags.lerobot_dataset import ChannelDelay

MOST_FPS = 1000


def add_export(actions: argparse._SubParsersAction) -> None:
    """Add `export` to the actions of `bag`."""
    export = actions.add_parser(
        'export',
        help='write recordings as a data set of LeRobot',
        description='Writes recordings as episodes of a data set of LeRobot (v3.0), at one rate: '
        'action, bending, wire tension, tip force, angle and effort of the motors, with a card '
        'that states how late each channel is. What was not recorded is left out and named. '
        "Needs LeRobot's library: `make -C ros_ws lerobot`.",
    )
    export.add_argument('bags', nargs='+', type=Path, metavar='BAG', help='rosbag2 folder or .mcap')
    export.add_argument(
        '--lerobot', type=Path, required=True, metavar='DIR', help='a new or empty folder'
    )
    export.add_argument(
        '--fps',
        type=within(1, MOST_FPS, int),
        metavar='N',
        help="frames a second (the tracker's rate)",
    )
    export.add_argument(
        '--plant',
        type=Path,
        metavar='P.yaml',
        help='plant of the rig, with which the delays of its channels are identified (they are '
        'unknown)',
    )
    export.add_argument(
        '--task',
        default='bend the tip as commanded',
        metavar='TEXT',
        help='what was done in the recordings (default: %(default)s)',
    )
    export.add_argument(
        '--namespace', metavar='NS', help="namespace of the rig's topics, if a bag has several rigs"
    )
    export.add_argument(
        '--jobs', type=COUNT, default=2, metavar='N', help='parallel tasks (default 2)'
    )
    add_json_option(export)


def export(args: argparse.Namespace) -> int:
    """Write the data set; return 0."""
    from endoscope_bags import open_bag
    from endoscope_bags.episode import channels_of, episodes_of, refuse_other_channels
    from endoscope_bags.lerobot_dataset import dataset_card, lerobot_dataset, write_lerobot
    from endoscope_bags.recording import kind_of_bag
    from endoscope_core.atomic_output import require_free_directory
    from endoscope_core.rig import kind_of_several

    # Before long work.
    require_free_directory(args.lerobot)
    lerobot_dataset()
    bags = [open_bag(path) for path in args.bags]
    recordings = [channels_of(bag, args.namespace) for bag in bags]
    refuse_other_channels(recordings)
    fps = args.fps or recordings[0].tracker_rate
    episodes = [episode for one in recordings for episode in episodes_of(one, fps)]
    delays = [_delays(path, args) for path in args.bags]
    kind = kind_of_several([kind_of_bag(bag) for bag in bags]).kind
    name = args.lerobot.resolve().name
    card = dataset_card(name, recordings, episodes, fps, kind, delays)
    write_lerobot(args.lerobot, recordings[0].channels, episodes, fps, args.task, card)
    lacking = recordings[0].lacking
    frames = sum(map(len, episodes))
    if args.json:
        print_json(
            {
                'dataset': args.lerobot,
                'fps': fps,
                'episodes': len(episodes),
                'frames': frames,
                'lacking': lacking,
                'delays': [[vars(delay) for delay in each] for each in delays],
            }
        )
        return 0
    print(f'{args.lerobot}: {frames} frames at {fps} a second, episodes: {len(episodes)}')
    for feature, why in lacking.items():
        print(f'{feature} is left out: {why}')
    return 0


def _delays(path: Path, args: argparse.Namespace) -> 'Sequence[ChannelDelay]':
    if args.plant is None:
        return ()
    from endoscope_core.physics import load_plant
    from endoscope_explain.fit.channel_delays import channel_delays
    from endoscope_explain.pipeline import Sources, read_inputs

    inputs = read_inputs(
        Sources(path, load_plant(args.plant), without=WAIVABLE, namespace=args.namespace)
    )
    return channel_delays(inputs.audit.recording, inputs.plant, args.jobs)

"""`endoscope bag`: lists, describes, cuts, recovers and exports recordings."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from endoscope_bringup.subcommands import add_json_option, add_options, print_json, within
from endoscope_core.choices import WAIVABLE
from endoscope_explain.options import Options

if TYPE_CHECKING:
    from endoscope_bags.lerobot_dataset import ChannelDelay

MOST_FPS = 1000


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `bag` with `list`, `info`, `cut`, `recover` and `export`."""
    parser = subparsers.add_parser(
        'bag', help='describe a recording, cut it, recover a damaged one, export it'
    )
    actions = parser.add_subparsers(dest='action', metavar='ACTION', required=True)
    one = argparse.ArgumentParser(add_help=False)
    one.add_argument('bag', metavar='BAG', type=Path, help='rosbag2 folder or .mcap file')
    listed = actions.add_parser(
        'list',
        help='list the recordings in a folder, with faults and marks',
        description='Lists the recordings in FOLDER, oldest first: kind, start and length, and for '
        'those of a fault or a mark its time and reason.',
    )
    listed.add_argument(
        'folder', metavar='FOLDER', type=Path, nargs='?', default=Path('bags'), help='(bags)'
    )
    add_json_option(listed)
    info = actions.add_parser(
        'info',
        parents=[one],
        help='topics, counts, rates, duration, pauses, gaps and losses',
        description='Lists the content of BAG, and what is missing from it. A periodic topic is '
        'silent where no message comes for more than 2.5 periods by the stamps of the source. It '
        'paused if nothing was published meanwhile, as the master does while it follows no handle; '
        'it has a gap if messages are missing there, or if this cannot be excluded. Lost are '
        'messages that were published and did not arrive ("?" if the recorder did not count them).',
    )
    add_json_option(info)
    cut = actions.add_parser(
        'cut',
        parents=[one],
        help='write a part of a recording to a new one',
        description='Writes the messages received between two times. The last earlier message of '
        'each latched topic comes first.',
    )
    cut.add_argument(
        '--from',
        dest='begin',
        type=within(0.0, 1e9, float),
        default=0.0,
        metavar='S',
        help='in s from the first receipt (0)',
    )
    cut.add_argument(
        '--to',
        dest='end',
        type=within(0.0, 1e9, float),
        metavar='S',
        help='in s from the first receipt (the end)',
    )
    cut.add_argument('--out', metavar='BAG2', type=Path, required=True, help='the new recording')
    recover = actions.add_parser(
        'recover',
        parents=[one],
        help='write the sound part of a damaged recording to a new one',
        description='Saves every sound chunk of a damaged recording, up to where its records break '
        'off.',
    )
    recover.add_argument('out', metavar='OUT', type=Path, help='the new recording')
    _add_export(actions)


def run(args: argparse.Namespace) -> int:
    """Print what was found or written; return 0."""
    if args.action == 'list':
        from endoscope_bags.listing import bags_in, listing

        entries = bags_in(args.folder)
        if args.json:
            print_json([entry.as_json() for entry in entries])
        else:
            print(listing(args.folder, entries))
    elif args.action == 'info':
        from endoscope_bags import open_bag
        from endoscope_bags.information import bag_information

        information = bag_information(open_bag(args.bag))
        if args.json:
            print_json(information.as_json())
        else:
            print(information)
    elif args.action == 'cut':
        from endoscope_bags.copying import cut

        print(cut(args.bag, args.out, args.begin, args.end))
    elif args.action == 'export':
        return _export(args)
    else:
        from endoscope_bags.copying import recover

        print(recover(args.bag, args.out))
    return 0


def _add_export(actions: argparse._SubParsersAction) -> None:
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
    add_options(export, Options, 'namespace', 'jobs')
    add_json_option(export)


def _export(args: argparse.Namespace) -> int:
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

"""`endoscope bag`: lists, describes, cuts, recovers and exports recordings."""

import argparse
from pathlib import Path

from endoscope_bringup.bag_export import add_export, export
from endoscope_bringup.subcommands import add_json_option, print_json, within


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `bag` with `list`, `info`, `cut`, `recover` and `export`."""
    parser = subparsers.add_parser(
        'bag', help='describe a recording, cut it, recover a damaged one, export it'
    )
    actions = parser.add_subparsers(dest='action', metavar='ACTION', required=True)
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
        help='topics, counts, rates, duration, pauses, gaps and losses',
        description='Lists the content of BAG, and what is missing from it. A periodic topic is '
        'silent where no message comes for more than 2.5 periods by the stamps of the source. It '
        'paused if nothing was published meanwhile, as the master does while it follows no handle; '
        'it has a gap if messages are missing there, or if this cannot be excluded. Lost are '
        'messages that were published and did not arrive ("?" if the recorder did not count them).',
    )
    info.add_argument('bag', metavar='BAG', type=Path, help='rosbag2 folder or .mcap file')
    add_json_option(info)
    cut = actions.add_parser(
        'cut',
        help='write a part of a recording to a new one',
        description='Writes the messages received between two times. The last earlier message of '
        'each latched topic comes first.',
    )
    cut.add_argument('bag', metavar='BAG', type=Path, help='rosbag2 folder or .mcap file')
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
        help='write the sound part of a damaged recording to a new one',
        description='Saves every sound chunk of a damaged recording, up to where its records break '
        'off.',
    )
    recover.add_argument('bag', metavar='BAG', type=Path, help='rosbag2 folder or .mcap file')
    recover.add_argument('out', metavar='OUT', type=Path, help='the new recording')
    add_export(actions)


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
        return export(args)
    else:
        from endoscope_bags.copying import recover

        print(recover(args.bag, args.out))
    return 0

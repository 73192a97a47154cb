"""`endoscope replay`: publishes a bag's topics again."""

import argparse

from endoscope_bringup.subcommands import within


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `replay`."""
    parser = subparsers.add_parser(
        'replay',
        help="publish a bag's topics at their pace or faster, with /clock",
        description='Publishes the recorded messages in the order of their receipt. Refuses to '
        'publish into a running system: use a separate ROS_DOMAIN_ID.',
    )
    parser.add_argument('bag', metavar='BAG', help='rosbag2 folder or .mcap file')
    parser.add_argument(
        '--speed',
        type=within(0.01, 100.0, float),
        default=1.0,
        help='recorded seconds per real second, 0.01 to 100 (default: %(default)g)',
    )
    parser.add_argument(
        '--topics', nargs='+', metavar='TOPIC', help='only these (full names; default: all)'
    )
    parser.add_argument('--no-clock', action='store_true', help='do not publish /clock')
    parser.add_argument(
        '--delay',
        type=within(0.0, 3600.0, float),
        default=1.0,
        help='seconds in which readers can be found before the first message '
        '(default: %(default)g)',
    )
    parser.add_argument(
        '--beside-live-nodes',
        action='store_true',
        help='replay even where other nodes publish the same topics; recorded commands then move '
        'whatever obeys them',
    )


def run(args: argparse.Namespace) -> int:
    """Replay; return 1 if it was refused."""
    from endoscope_bringup.commands.record import ros_arguments
    from endoscope_nodes.runtime.stop_signals import end_when_asked

    end_when_asked('endoscope')
    from endoscope_nodes.nodes.replay import ReplayNode
    from endoscope_nodes.runtime.runtime import run_nodes

    parameters: dict[str, object] = {
        'bag': args.bag,
        'speed': args.speed,
        'clock': not args.no_clock,
        'delay': args.delay,
        'beside_live_nodes': args.beside_live_nodes,
    }
    if args.topics:
        parameters['topics'] = args.topics
    return run_nodes([ReplayNode], ros_arguments(parameters))

"""`endoscope record`: records topics into a bag until it is interrupted."""

import argparse
import json


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `record`."""
    parser = subparsers.add_parser(
        'record',
        help='record topics into a bag',
        description='Records until Ctrl-C, SIGTERM or SIGHUP. Exits 1 if a message was lost or the '
        'disk was full; what was recorded is kept.',
    )
    parser.add_argument(
        '--out',
        default='',
        metavar='BAG',
        help='where to write: a bare file if it ends in .mcap, else a folder; never overwritten '
        '(default: bags/recording-DATE-TIME)',
    )
    parser.add_argument(
        '--topics',
        nargs='+',
        metavar='TOPIC',
        help='instead of all public topics of the endoscope',
    )
    parser.add_argument(
        '--namespace', default='endoscope', help='of relative topics (default: %(default)s)'
    )
    parser.add_argument('--sim-time', action='store_true', help='take the time from /clock')


def run(args: argparse.Namespace) -> int:
    """Record; return 1 if something is missing from the bag."""
    from endoscope_nodes.runtime.stop_signals import end_when_asked

    end_when_asked('endoscope')
    from endoscope_bags.recorder import new_bag
    from endoscope_nodes.nodes.recorder import RecorderNode
    from endoscope_nodes.runtime.runtime import run_nodes

    # The bags of faults are written by the recorder of the graph.
    parameters = {'bag': args.out or new_bag(), 'use_sim_time': args.sim_time, 'keep': 0.0}
    if args.topics:
        parameters['topics'] = args.topics
    return run_nodes([RecorderNode], ros_arguments(parameters, args.namespace))


def ros_arguments(parameters: dict[str, object], namespace: str | None = None) -> list[str]:
    """Return ROS arguments that set parameters exactly, whatever characters they hold."""
    arguments = ['--ros-args']
    if namespace is not None:
        arguments += ['-r', f'__ns:=/{namespace.strip("/")}']
    for name, value in parameters.items():
        arguments += ['-p', f'{name}:={json.dumps(value)}']
    return arguments

"""`endoscope teleop`: moves the slave by the keyboard of a terminal, as long as a key is held."""

import argparse

from endoscope_bringup.subcommands import add_graph_options, within

_KEYS = """\
keys:
  arrows, or W A S D   bend while held: left and right bend_x, down and up bend_y
  [ ]                  slower, faster
  E                    enable, or resume after a pause: a session is opened, nothing moves yet
  P                    pause: the session ends, the slave holds where it is
  H                    home while held: the motors go back to zero; if it is released before
                       they are there, the graph is paused
  Q, Ctrl-C, Ctrl-Z    quit
  space, any other     stop

A held key is the dead-man, by its repeats: the slave moves from the first one, which comes after
the keyboard's own delay of 0.25 to 0.66 s, and stops 0.15 s after the last one; a keyboard that
repeats before 0.18 or after 0.7 s moves nothing. After a stop without a release the key has to be
released and pressed again.

The slave follows while the graph is ENABLED and `master.source` is `master`, which is set with
your consent and set back at the end. Whatever ends this program, the clutch is released first: Q,
Ctrl-C, SIGTERM, a closed terminal; after a kill -9 the graph stops by itself, since the
handle is silent.
"""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `teleop`."""
    parser = subparsers.add_parser(
        'teleop',
        help='move the slave by the keyboard of a terminal; a held key is the dead-man',
        description='Moves the slave of a running graph by the keyboard, as long as a key is held.',
        epilog=_KEYS,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        '--take', action='store_true', help='set master.source to master without asking'
    )
    parser.add_argument(
        '--speed',
        type=within(3.0, 57.0, float),
        default=17.0,
        metavar='DEG_S',
        help='initial speed of the handle, 3 to 57 deg/s (default: %(default)g)',
    )
    parser.add_argument(
        '--scale',
        type=within(0.01, 10.0, float),
        help="slave motion for one radian of the handle; default the master's own",
    )
    add_graph_options(parser, 'an answer of the graph')


def run(args: argparse.Namespace) -> int:
    """Teleoperate until Q; return 1 if the graph refuses it."""
    import sys

    from endoscope_bringup.teleop.terminal import check_terminal

    check_terminal()
    from endoscope_bringup.teleop.teleoperation import teleoperate
    from endoscope_nodes.client.graph_client import joined_graph
    from endoscope_nodes.client.graph_listener import GraphError

    try:
        with joined_graph('teleop', args.namespace) as client:
            return teleoperate(client, args)
    except GraphError as error:
        print(f'teleop: {error}', file=sys.stderr)
        return 1

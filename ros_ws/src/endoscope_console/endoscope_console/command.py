"""`endoscope console`: the page by which a person operates, and its server."""

import argparse
from pathlib import Path

DEFAULT_PORT = 8642
SLOWEST_HZ, RATE_HZ = 10, 30
DEFAULT_VIEWERS_PORT = 8765
"""Where viewers look for a server first."""

_EPILOG = """\
The printed address contains a token, which grants control. The page is reachable from this machine
only; --host with an address of this machine admits others and needs a certificate. Ctrl-C ends the
page and, if this command started it, the graph.
"""


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `console`."""
    parser = subparsers.add_parser(
        'console',
        help='operate in the browser; starts a graph unless one runs',
        description='Serves the page on which a person operates and monitors the slave and '
        'explains recordings, and prints its address. Starts a graph unless one answers.',
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument(
        '--host',
        default='127.0.0.1',
        metavar='ADDRESS',
        help='address of this machine at which the page is reached (default: %(default)s)',
    )
    parser.add_argument(
        '--port',
        type=_port,
        default=DEFAULT_PORT,
        help='port; 0 for any that is free (default: %(default)d)',
    )
    parser.add_argument(
        '--certificate', type=Path, metavar='FILE', help='for https: certificate chain, PEM'
    )
    parser.add_argument('--key', type=Path, metavar='FILE', help='its private key, PEM')
    parser.add_argument(
        '--token-file',
        type=Path,
        metavar='FILE',
        help='store the tokens in FILE, so that the addresses stay; by default they are new each '
        'time',
    )
    parser.add_argument(
        '--origin',
        action='append',
        default=[],
        metavar='URL',
        help='another address under which the page is reached, for example that of a proxy',
    )
    parser.add_argument(
        '--allow-no-origin',
        action='store_true',
        help='allow programs that are not browsers to open the sockets; they need the token too',
    )
    parser.add_argument(
        '--no-graph', action='store_true', help='start no graph, wait for one to answer'
    )
    parser.add_argument(
        '--real-time',
        action='store_true',
        help='run the started graph by the wall clock even if all devices are simulated',
    )
    parser.add_argument(
        '--graph',
        default='',
        metavar='ARGUMENTS',
        help="further arguments for the graph that is started: '-p tick_rate:=500'",
    )
    parser.add_argument(
        '--rig', type=Path, metavar='RIG.yaml', help="the graph's rig file; default as shipped"
    )
    parser.add_argument(
        '--bags',
        type=Path,
        default=Path('bags'),
        metavar='DIR',
        help='folder of recordings to explain, and of their explanations (default: %(default)s)',
    )
    parser.add_argument(
        '--rate',
        type=int,
        choices=range(SLOWEST_HZ, RATE_HZ + 1),
        default=RATE_HZ,
        metavar='HZ',
        help='pictures a second (default: %(default)d; 10 relieves a busy machine)',
    )
    parser.add_argument(
        '--namespace', default='endoscope', help='namespace of the graph (default: %(default)s)'
    )
    parser.add_argument(
        '--viewers',
        action='store_true',
        help='allow Foxglove and Lichtblick on this machine to read the topics, without a token',
    )
    parser.add_argument(
        '--viewers-port',
        type=_port,
        default=DEFAULT_VIEWERS_PORT,
        metavar='PORT',
        help='port for viewers; 0 for any that is free (default: %(default)d)',
    )


def _port(text: str) -> int:
    port = int(text)
    if not 0 <= port < 65536:
        raise ValueError(text)
    return port


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C; return 0."""
    from endoscope_console.serving import serve

    return serve(args)

"""`endoscope topics`: lists the topics, missing publishers, and messages."""

import argparse

from endoscope_bringup.subcommands import COUNT, SECONDS, add_graph_options


def add_parser(subparsers: argparse._SubParsersAction) -> None:
    """Add `topics`."""
    parser = subparsers.add_parser(
        'topics',
        help="list the graph's topics with publishers and subscribers, and what is missing",
        description='Without options lists the topics of the interface with their senders and '
        'readers, and what is missing. Exits 0, or 1 if a requested topic has no sender.',
    )
    parser.add_argument(
        '--echo', metavar='NAME', help='print the messages of a topic, each as a line of JSON'
    )
    parser.add_argument('--once', action='store_true', help='with --echo: only one message')
    parser.add_argument('--count', type=COUNT, metavar='N', help='end after N messages')
    parser.add_argument('--seconds', type=SECONDS, metavar='S', help='end after S seconds')
    parser.add_argument('--json', action='store_true', help='the list as JSON')
    add_graph_options(parser, 'a sender', 'of the graph and of names that begin with no /')


def run(args: argparse.Namespace) -> int:
    """List or print; return 1 where nobody sends."""
    import sys

    from endoscope_bringup.operating.listening import echo, listing
    from endoscope_nodes.client.graph_client import joined_graph
    from endoscope_nodes.client.graph_listener import GraphError

    count = 1 if args.once else args.count
    try:
        with joined_graph('topics', args.namespace) as client:
            if args.echo:
                echo(client, args.echo, count, args.seconds, args.timeout)
            else:
                listing(client, args.timeout, args.json)
    except GraphError as error:
        print(f'topics: {error}', file=sys.stderr)
        return 1
    return 0

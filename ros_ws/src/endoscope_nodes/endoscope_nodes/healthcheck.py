"""The program `healthcheck`: whether a node has spoken on ``/diagnostics`` just now.

For container engines, which run it now and then beside the node: it loads nothing that a node does.
"""

import argparse
import sys
import time
from collections.abc import Sequence

from endoscope_core.exit_status import exit_status
from endoscope_nodes.program import NODES

_LONGEST_S = 5.0


def is_heard(node: str, namespace: str, longest_s: float) -> bool:
    """Listen to ``/diagnostics`` for up to `longest_s` s until a node speaks, as it does each s."""
    # Only now: whoever asks for help need not wait for ROS.
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.executors import SingleThreadedExecutor

    from endoscope_nodes.names import DIAGNOSTICS
    from endoscope_nodes.runtime.environment import joined_node
    from endoscope_nodes.runtime.qos import EVENT

    names = {node, f'/{namespace.strip("/")}/{node}'}
    heard: list[str] = []

    def listen(message: DiagnosticArray) -> None:
        heard.extend(status.name.partition(':')[0] for status in message.status)

    with joined_node(f'healthcheck_of_{node}', '') as listener:
        listener.create_subscription(DiagnosticArray, DIAGNOSTICS, listen, EVENT)
        executor = SingleThreadedExecutor(context=listener.context)
        executor.add_node(listener)
        deadline = time.monotonic() + longest_s
        try:
            while not names & set(heard) and (left := deadline - time.monotonic()) > 0:
                executor.spin_once(timeout_sec=left)
        finally:
            executor.shutdown()
    return bool(names & set(heard))


def main(argv: Sequence[str] | None = None) -> int:
    """Return 0 if the node speaks, 1 if it is silent, 2 for wrong usage."""
    return exit_status('healthcheck', lambda: _run(argv))


def _run(argv: Sequence[str] | None) -> int:
    parser = argparse.ArgumentParser(
        prog='healthcheck',
        description='Exits 0 if a node speaks on /diagnostics, 1 if it is silent.',
    )
    parser.add_argument('node', choices=NODES, metavar='NODE', help=', '.join(NODES))
    parser.add_argument(
        '--namespace', default='endoscope', help='of the node (default: %(default)s)'
    )
    args = parser.parse_args(argv)
    if is_heard(args.node, args.namespace, _LONGEST_S):
        return 0
    print(f'healthcheck: {args.node} has been silent for {_LONGEST_S:g} s', file=sys.stderr)
    return 1

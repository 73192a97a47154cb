"""What an interruption means while the slave is being moved: it is paused."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from endoscope_nodes.client.graph_client import GraphClient

_HUNG_UP = 128 + signal.SIGHUP
_ANSWERED_S = 2.0


@contextmanager
def paused_when_interrupted(client: GraphClient, moving: bool) -> Iterator[None]:
    """Pause the graph if the block is ended by SIGINT, SIGTERM or SIGHUP while it has it move."""

    def unwind(number: int, frame: FrameType | None) -> None:
        raise SystemExit(_HUNG_UP)

    # Whoever starts a program by `nohup` wants it to outlive the terminal.
    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    previous = signal.SIG_IGN if ignored else signal.signal(signal.SIGHUP, unwind)
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        if moving:
            client.order('pause')
            client.wait_until(lambda: client.state != 'ENABLED', _ANSWERED_S)
            print(f'interrupted: the graph is {client.state or "silent"}', file=sys.stderr)
        raise
    finally:
        signal.signal(signal.SIGHUP, previous)

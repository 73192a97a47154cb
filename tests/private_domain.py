"""ROS domains that neither a person nor another test uses."""

import itertools
import os

# Domains from 100 on keep away from those of a person; each process begins with its own.
_DOMAINS = itertools.cycle(range(100, 230))
_FIRST = os.getpid() % 130


def private_domain() -> int:
    """Give one, other than the last 129."""
    return (next(_DOMAINS) + _FIRST) % 130 + 100

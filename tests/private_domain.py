"""ROS domains that neither a person nor another test uses, in this process or any other."""

import fcntl
import itertools
import os
import tempfile
from pathlib import Path

# Domains from 100 on keep away from those of a person; each process begins with its own.
_FIRST = os.getpid() % 130
_DOMAINS = itertools.cycle(100 + (_FIRST + k) % 130 for k in range(130))
_held = {}


def private_domain() -> int:
    """Give one that no other process holds, other than the last ones given here."""
    for _ in range(130):
        domain = next(_DOMAINS)
        if domain in _held or _lock(domain):
            return domain
    raise RuntimeError('every ROS domain from 100 to 229 is held by a test')


def _lock(domain: int) -> bool:
    file = (Path(tempfile.gettempdir()) / f'endoscope-domain-{domain}.lock').open('w')
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return False
    _held[domain] = file
    return True

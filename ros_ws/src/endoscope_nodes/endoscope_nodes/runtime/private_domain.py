"""ROS domains that nobody else uses, for graphs beside those of persons, benches and tests."""

import fcntl
import itertools
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import TextIO

# DDS opens ports by domain and nothing says which ones are taken. Domains from 100 on keep away
# from those of persons, who begin at 0, and up to 229 all their ports exist; each process begins
# with its own, and a locked file says to the others that it has it.
_FIRST, _COUNT = 100, 130
_DOMAINS = itertools.cycle(_FIRST + (os.getpid() + k) % _COUNT for k in range(_COUNT))
_held: dict[int, TextIO] = {}


def private_domain() -> int:
    """Give one that no other process holds, other than the last ones given here."""
    for _ in range(_COUNT):
        domain = next(_DOMAINS)
        if domain in _held or _lock(domain):
            return domain
    raise RuntimeError(f'every ROS domain from {_FIRST} to {_FIRST + _COUNT - 1} is held')


@cache
def process_domain() -> int:
    """The one for graphs of this process that run one after the other."""
    # With one each, a long bench would come to hold them all.
    return private_domain()


@contextmanager
def domains_given_back() -> Iterator[None]:
    """Give back at its end what was given within: tests of one file, say, of the many of a run."""
    before = set(_held)
    process_domain.cache_clear()
    try:
        yield
    finally:
        process_domain.cache_clear()
        for domain in set(_held) - before:
            _held.pop(domain).close()


def _lock(domain: int) -> bool:
    file = (Path(tempfile.gettempdir()) / f'endoscope-domain-{domain}.lock').open('w')
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return False
    _held[domain] = file
    return True

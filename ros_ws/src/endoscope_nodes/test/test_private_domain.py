"""ROS domains of one's own."""

import fcntl
import tempfile
from pathlib import Path

import pytest

from endoscope_nodes.runtime.private_domain import (
    domains_given_back,
    private_domain,
    process_domain,
)


def lock(domain):
    """Take a domain as another process does."""
    with (Path(tempfile.gettempdir()) / f'endoscope-domain-{domain}.lock').open('w') as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def test_what_is_held_is_nobody_elses_until_it_is_given_back():
    with domains_given_back():
        domains = private_domain(), process_domain()
        for domain in domains:
            with pytest.raises(BlockingIOError):
                lock(domain)
    for domain in domains:
        lock(domain)

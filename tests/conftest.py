"""Settings for all tests across packages."""

import os
import sys
from pathlib import Path

import pytest

# pytest imports each test file by its path; what they share is imported by name.
sys.path.insert(0, str(Path(__file__).parent))
# Wrong types in messages are errors in tests; rclpy reads this when message classes are imported.
os.environ['ROS_PYTHON_CHECK_FIELDS'] = '1'
# Tests talk to nobody outside this machine.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'

pytest_plugins = ['run_report', 'explained_corpus']


@pytest.fixture(autouse=True)
def explained_once(corpus):
    """Refuse the engine what the corpus has not."""


@pytest.fixture(autouse=True, scope='module')
def own_domains():
    """Let a run of many files hold no more ROS domains than one of them needs."""
    from endoscope_nodes.runtime.private_domain import domains_given_back

    with domains_given_back():
        yield


@pytest.fixture(scope='module')
def browser():
    # Only tests in a browser need what it is driven by.
    from chromium import chromium

    with chromium() as browser:
        yield browser

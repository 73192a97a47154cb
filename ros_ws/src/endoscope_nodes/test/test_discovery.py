"""Nodes are found on this machine alone unless the operator says otherwise."""

import os
import subprocess
import sys

import pytest

SHOW = """
import os
from rclpy.context import Context
from endoscope_nodes.runtime import Runtime
with Runtime(['--ros-args'], Context(), 227):
    print(os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'])
"""


@pytest.mark.parametrize(('given', 'used'), [(None, 'LOCALHOST'), ('OFF', 'OFF')])
def test_the_range_of_discovery(given, used):
    environment = {k: v for k, v in os.environ.items() if k != 'ROS_AUTOMATIC_DISCOVERY_RANGE'}
    if given:
        environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] = given
    shown = subprocess.run(
        [sys.executable, '-c', SHOW], env=environment, capture_output=True, text=True, check=True
    )
    assert shown.stdout.split() == [used]

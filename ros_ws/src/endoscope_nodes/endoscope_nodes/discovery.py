"""Keeps DDS on this machine unless the operator says otherwise."""

import os
from pathlib import Path

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PEERS = 'ROS_STATIC_PEERS'
PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
LOOPBACK = Path(__file__).with_name('this_machine.xml')


def stay_on_this_machine() -> None:
    """Let this machine alone reach the nodes; call it before a context is initialised.

    Whoever can reach the topics can move the slave, and without DDS-Security nothing else stops
    them.  `ROS_AUTOMATIC_DISCOVERY_RANGE` in the environment (`SUBNET` for other machines) wins,
    and so do `ROS_STATIC_PEERS` and a profile of one's own for Fast DDS.
    """
    # ROS 2 takes an empty range for SUBNET.
    if not os.environ.get(RANGE):
        os.environ[RANGE] = 'LOCALHOST'
    if os.environ[RANGE] == 'LOCALHOST' and not os.environ.get(PEERS):
        os.environ.setdefault(PROFILES, str(LOOPBACK))

"""Keeps DDS on this machine unless the operator says otherwise."""

import os

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'


def stay_on_this_machine() -> None:
    """Let nodes find each other on this machine alone; call it before a context is initialised.

    Whoever can reach the topics can move the slave, and without DDS-Security nothing else stops
    them.  `ROS_AUTOMATIC_DISCOVERY_RANGE` in the environment (`SUBNET` for other machines) wins.
    """
    os.environ.setdefault(RANGE, 'LOCALHOST')

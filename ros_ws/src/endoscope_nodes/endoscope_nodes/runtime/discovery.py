"""Keeps DDS on this machine unless the operator says otherwise."""

import os
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from endoscope_core.errors import EndoscopeError

RANGE = 'ROS_AUTOMATIC_DISCOVERY_RANGE'
PEERS = 'ROS_STATIC_PEERS'
PROFILES = 'FASTRTPS_DEFAULT_PROFILES_FILE'
PROFILES_OF_FAST_DDS_3 = 'FASTDDS_DEFAULT_PROFILES_FILE'
"""Its name from ROS 2 Kilted on, which heeds the old one too and warns of it."""
_MIDDLEWARE = 'fastrtps'
_RCLPY_OF_JAZZY = 7
LOOPBACK = Path(__file__).with_name('this_machine.xml')
# OFF is nobody but this process, for which Fast DDS listens at every address all the same.
_ON_THIS_MACHINE = ('LOCALHOST', 'OFF')
_WIDER = ('SUBNET', 'SYSTEM_DEFAULT')


class DiscoveryRangeError(EndoscopeError, ValueError):
    """A discovery range that ROS 2 does not know, and would take for `SUBNET`."""


def stay_on_this_machine() -> None:
    """Let this machine alone reach the nodes; call it before a context is initialised.

    Whoever can reach the topics can move the slave, and without DDS-Security nothing else stops
    them. `ROS_AUTOMATIC_DISCOVERY_RANGE` in the environment (`SUBNET` for other machines) wins, and
    so do `ROS_STATIC_PEERS` and a profile of one's own for Fast DDS.
    """
    # ROS 2 takes an empty range for SUBNET.
    chosen = os.environ.get(RANGE) or 'LOCALHOST'
    if chosen not in _ON_THIS_MACHINE + _WIDER:
        raise DiscoveryRangeError(
            f'{RANGE} is {chosen!r}; give LOCALHOST for this machine alone, OFF for this process '
            'alone, SUBNET for other machines too, or SYSTEM_DEFAULT for what Fast DDS does by '
            'itself'
        )
    from rclpy.utilities import get_rmw_implementation_identifier

    os.environ[RANGE] = chosen
    if chosen in _ON_THIS_MACHINE and not os.environ.get(PEERS):
        heeded = _heeded()
        if not any(name in os.environ for name in heeded):
            os.environ[heeded[0]] = str(LOOPBACK)
            # The profile says where to look for others; for LOCALHOST, ROS 2 would add the shared
            # memory to its transport. Another middleware knows no profile, and keeps to the range.
            if chosen == 'LOCALHOST' and _MIDDLEWARE in get_rmw_implementation_identifier():
                os.environ[RANGE] = 'SYSTEM_DEFAULT'


def _heeded() -> tuple[str, ...]:
    """The variables that name a profile for the Fast DDS that is there, its own name first."""
    for distribution in ('ros-rclpy', 'rclpy'):
        with suppress(PackageNotFoundError):
            major = int(version(distribution).split('.')[0])
            return (PROFILES,) if major <= _RCLPY_OF_JAZZY else (PROFILES_OF_FAST_DDS_3, PROFILES)
    return (PROFILES,)

"""Topics of a recording, their quality of service and their messages."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import yaml

from endoscope_core.errors import FileError
from endoscope_core.schema import parse_yaml

_INFINITE = {'sec': 9223372036, 'nsec': 854775807}
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class QosProfile:
    """What a publisher offered."""

    reliability: str = 'reliable'  # or 'best_effort'
    durability: str = 'volatile'  # or 'transient_local'
    depth: int = 10  # of the history; 0 where the publisher did not say
    history: str = 'keep_last'  # or 'keep_all', 'unknown'

    def as_rosbag2(self) -> dict[str, Any]:
        """Return the mapping that rosbag2 writes; the time limits are unset (infinite)."""
        return {
            'history': self.history,
            'depth': self.depth,
            'reliability': self.reliability,
            'durability': self.durability,
            'deadline': dict(_INFINITE),
            'lifespan': dict(_INFINITE),
            'liveliness': 'automatic',
            'liveliness_lease_duration': dict(_INFINITE),
            'avoid_ros_namespace_conventions': False,
        }


SENSOR_QOS = QosProfile(depth=100)
COMMAND_QOS = QosProfile(depth=1)
LATCHED_QOS = QosProfile(durability='transient_local', depth=1)


def qos_as_yaml(profiles: Sequence[QosProfile]) -> str:
    """Return the text for the channel metadata `offered_qos_profiles`; empty for no profile."""
    if not profiles:
        return ''
    return yaml.safe_dump([p.as_rosbag2() for p in profiles], sort_keys=False).strip()


def qos_from_yaml(text: str) -> tuple[QosProfile, ...]:
    """Return the profiles in the channel metadata of any rosbag2 version; none for no text."""
    entries = parse_yaml(text, 'the quality of service') if text.strip() else []
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise FileError(f'the quality of service is {text!r}: not a list of profiles')
    return tuple(_from_entry(entry) for entry in entries)


def _from_entry(entry: dict[str, Any]) -> QosProfile:
    def named(key: str, names: tuple[str, ...]) -> str:
        value = entry.get(key)
        # Before version 9 rosbag2 wrote the policies as the numbers of rmw.
        if isinstance(value, int):
            return names[value] if 0 <= value < len(names) else 'unknown'
        if value is not None and not isinstance(value, str):
            raise FileError(f'the quality of service has {value!r} as its {key}')
        return value or 'unknown'

    depth = entry.get('depth') or 0
    if not isinstance(depth, int):
        raise FileError(f'the quality of service has {depth!r} as its depth')
    return QosProfile(
        reliability=named('reliability', ('system_default', 'reliable', 'best_effort')),
        durability=named('durability', ('system_default', 'transient_local', 'volatile')),
        depth=max(depth, 0),
        history=named('history', ('system_default', 'keep_last', 'keep_all')),
    )


@dataclass(frozen=True)
class Topic:
    """A topic of a recording."""

    name: str  # full, for example ``'/endoscope/motor/measured_js'``
    type: str  # for example ``'sensor_msgs/msg/JointState'``
    message_count: int
    definition: str  # `ros2msg` text of the type as recorded
    type_hash: str  # RIHS01; empty where the recorder did not say, like `qos`
    qos: tuple[QosProfile, ...]  # what the publishers offered


class RawMessage(NamedTuple):
    """One message as it was recorded; times in ns since the epoch."""

    topic: str
    log_ns: int
    publish_ns: int
    sequence: int
    data: bytes


class MessageTimes(NamedTuple):
    """Receipt, publication (ns since the epoch) and counter of a topic's messages, each (N,)."""

    log_ns: IntArray
    publish_ns: IntArray
    sequence: IntArray

"""What a recording says of its topics and messages."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from endoscope_bags.qos_profile import QosProfile

IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Topic:
    """A topic of a recording.

    Attributes
    ----------
    name
        Full name, for example ``'/endoscope/motor/measured_js'``.
    type
        Message type, for example ``'sensor_msgs/msg/JointState'``.
    message_count
        Number of messages.
    definition
        `ros2msg` text of the type as recorded.
    type_hash
        RIHS01 hash as recorded; empty where the recorder did not say.
    qos
        What the publishers offered; empty where the recorder did not say.
    """

    name: str
    type: str
    message_count: int
    definition: str
    type_hash: str
    qos: tuple[QosProfile, ...]


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

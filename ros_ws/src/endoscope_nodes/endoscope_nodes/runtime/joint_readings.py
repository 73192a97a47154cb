"""Joint states that a node reads past the executor, many at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from endoscope_bags.cdr_decoding import Payloads
from endoscope_bags.errors import BagError
from endoscope_bags.joint_state_series import JointStateSeries, decode_joint_states
from endoscope_nodes import topics
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.streams import RawSubscription

Array = NDArray[np.float64]

# Of a stream at 1 kHz, four times what comes in a quarter of a second.
_ASKED = profile(replace(topics.SENSOR_ASKED, depth=1000))


@dataclass
class JointReadings:
    """Joint states of fixed names that wait to be read."""

    subscription: RawSubscription
    names: Sequence[str]
    columns: Callable[[JointStateSeries], Sequence[Array]]  # what is read of them, each (N, J)
    unreadable: int = 0  # messages without a number of theirs

    @classmethod
    def of(
        cls,
        node: Node,
        topic: str,
        names: Sequence[str],
        columns: Callable[[JointStateSeries], Sequence[Array]],
    ) -> 'JointReadings':
        """Subscribe a node to a topic."""
        return cls(RawSubscription(node, JointState, topic, _ASKED), names, columns)

    def take(self) -> tuple[NDArray[np.int64], Array]:
        """Stamps (N,) in ns and values of what waits, as far as it is readable."""
        data = [message for message, _ in self.subscription.take()]
        size = np.array([len(each) for each in data], dtype=np.int64)
        none = np.zeros(len(data), dtype=np.int64)
        payloads = Payloads(b''.join(data), np.cumsum(size) - size, size)
        try:
            if data:
                decoded = decode_joint_states(self.subscription.topic, payloads, none, none, none)
                values = np.hstack(self.columns(decoded.select(self.names)))
                # Somebody else's joints on this topic would have none of our numbers.
                ours = np.isfinite(values).any(axis=1)
                self.unreadable += int((~ours).sum())
                return decoded.stamp_ns[ours], values[ours]
        except BagError:
            self.unreadable += len(data)
        return none[:0], np.empty((0, 0))

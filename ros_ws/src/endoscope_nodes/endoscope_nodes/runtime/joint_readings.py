"""Joint states that a node reads past the executor, many at a time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from endoscope_bags.cdr import Payloads
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


class RigReadings:
    """All that a node follows of the rig, by the names of the samples that they become."""

    def __init__(self) -> None:
        self.streams: dict[str, JointReadings] = {}
        self.origin_ns = 0  # first stamp of the motors, from which seconds count

    def heard(self) -> list[tuple[str, int]]:
        """Topics that are read past the executor, and how many publishers each has found."""
        heard = [stream.subscription for stream in self.streams.values()]
        return [(each.topic, each.count_publishers()) for each in heard]

    def pass_on(self, model: object) -> dict[str, float]:
        """Append what waits to the samples of a model; newest of each stream that said something.

        In s since the motors began to.
        """
        taken = {name: stream.take() for name, stream in self.streams.items()}
        stamps, _ = taken['motor']
        if len(stamps) and not self.origin_ns:
            self.origin_ns = int(stamps[0])
        if not self.origin_ns:
            return {}
        newest = {}
        for name, (stamp_ns, values) in taken.items():
            if len(stamp_ns):
                seconds = (stamp_ns - self.origin_ns) * 1e-9
                newest[name] = float(seconds[-1])
                getattr(model, name).append(seconds, values)
        return newest

    def forget(self) -> None:
        """Drop what waits, and count seconds from what comes."""
        for stream in self.streams.values():
            stream.subscription.take()
        self.origin_ns = 0

    def close(self) -> None:
        """Leave the topics."""
        for stream in self.streams.values():
            stream.subscription.close()

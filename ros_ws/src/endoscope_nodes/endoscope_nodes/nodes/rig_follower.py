"""A node whose model of the rig, by the plant in force, is computed in a thread beside its beat."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import replace

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from numpy.typing import NDArray
from rclpy.node import Node
from sensor_msgs.msg import JointState

from endoscope_bags.cdr import Payloads
from endoscope_bags.errors import BagError
from endoscope_bags.joint_state_series import decode_joint_states
from endoscope_nodes import names, topics
from endoscope_nodes.client.plant_adoption import PlantInForce
from endoscope_nodes.runtime.endoscope_node import Beside, EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.qos import RESULT, profile
from endoscope_nodes.runtime.streams import RawSubscription

Array = NDArray[np.float64]
Stream = tuple[str, Sequence[str], Sequence[str]]
"""A topic of joint states, the names on it, and what is read of them.

The first has to be there, the others are NaN where they are not.
"""

STREAMS: dict[str, Stream] = {
    'motor': (names.MOTOR_MEASURED, names.MOTORS, ['position']),
    'wires': (names.WIRES_MEASURED, names.WIRES, ['effort']),
    'tracker': (names.SLAVE_MEASURED, names.JOINTS, ['position']),
}
"""By the names of the samples of a model that they become."""
# Of a stream at 1 kHz, four times what comes in a quarter of a second.
_ASKED = profile(replace(topics.SENSOR_ASKED, depth=1000))


class JointReadings:
    """Joint states that a node reads past the executor, many at a time."""

    def __init__(self, node: Node, stream: Stream) -> None:
        topic, self._names, self._quantities = stream
        self.subscription = RawSubscription(node, JointState, topic, _ASKED)
        self.unreadable = 0  # messages without a number of theirs

    def take(self) -> tuple[NDArray[np.int64], Array]:
        """Stamps (N,) in ns and values of what waits, as far as it is readable."""
        data = [message for message, _ in self.subscription.take()]
        size = np.array([len(each) for each in data], dtype=np.int64)
        none = np.zeros(len(data), dtype=np.int64)
        payloads = Payloads(b''.join(data), np.cumsum(size) - size, size)
        try:
            if data:
                decoded = decode_joint_states(self.subscription.topic, payloads, none, none, none)
                series = decoded.select(self._names)
                first = series.require(self._quantities[0])
                others = [getattr(series, quantity) for quantity in self._quantities[1:]]
                missing = np.full_like(first, np.nan)
                values = np.hstack([first, *(missing if v is None else v for v in others)])
                # Somebody else's joints on this topic would have none of our numbers.
                ours = np.isfinite(values).any(axis=1)
                self.unreadable += int((~ours).sum())
                return decoded.stamp_ns[ours], values[ours]
        except BagError:
            self.unreadable += len(data)
        return none[:0], np.empty((0, 0))


class RigFollower[T](EndoscopeNode):
    """Hands what it hears of the rig to a model, and takes what a thread makes of it.

    The plant is the one in force: the adopted one, or else the one described.
    """

    def __init__(self, name: str, context: NodeContext) -> None:
        super().__init__(name, context)
        self._streams: dict[str, JointReadings] = {}
        self._origin_ns = 0  # first stamp of the motors, from which seconds count
        self._adopted = PlantInForce()
        self._wanted = False  # to begin anew with the plant in force
        self._beside = Beside(self.ticker)
        self._working: Future[T] | None = None

    def _follow(self, streams: Mapping[str, Stream], period: float) -> None:
        """Begin to hear streams, and to have them looked at every `period` s."""
        self._streams = {name: JointReadings(self, stream) for name, stream in streams.items()}
        self.create_subscription(DiagnosticArray, names.COMPENSATOR_PLANT, self._on_plant, RESULT)
        self.ticker.every(period, self._look)

    def _on_plant(self, message: DiagnosticArray) -> None:
        reported = PlantInForce.of_message(message)
        if reported is not None and reported.hash != self._adopted.hash:
            self._adopted, self._wanted = reported, True

    def _look(self) -> None:
        """Take what was worked out, and have what came since then worked out."""
        if self._working is not None:
            if not self._working.done():
                return
            self._take(self._working.result())
        self._working = self._beside.submit(self._next())

    def _take(self, found: T) -> None:
        """Report what was worked out."""
        raise NotImplementedError

    def _next(self) -> Callable[[], T]:
        """Return what to work out next, in the thread."""
        raise NotImplementedError

    def _pass_on(self, model: object) -> dict[str, float]:
        """Append what waits to the samples of a model; newest of each stream that said something.

        In s since the motors began to.
        """
        taken = {name: stream.take() for name, stream in self._streams.items()}
        stamps, _ = taken['motor']
        if len(stamps) and not self._origin_ns:
            self._origin_ns = int(stamps[0])
        if not self._origin_ns:
            return {}
        newest = {}
        for name, (stamp_ns, values) in taken.items():
            if len(stamp_ns):
                seconds = (stamp_ns - self._origin_ns) * 1e-9
                newest[name] = float(seconds[-1])
                getattr(model, name).append(seconds, values)
        return newest

    def _forget(self) -> None:
        """Drop what waits, and count seconds from what comes."""
        for stream in self._streams.values():
            stream.subscription.take()
        self._origin_ns = 0

    def extra_readers(self) -> list[tuple[str, int]]:
        """Topics that are read past the executor, and how many publishers each has found."""
        heard = [stream.subscription for stream in self._streams.values()]
        return [(each.topic, each.count_publishers()) for each in heard]

    def close(self) -> None:
        """Let the thread end, and leave the topics."""
        self._beside.close()
        for stream in self._streams.values():
            stream.subscription.close()

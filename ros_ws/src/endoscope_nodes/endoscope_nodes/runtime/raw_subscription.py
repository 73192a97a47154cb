"""A subscription that is emptied by its owner instead of by the executor."""

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_for_type_support


class RawSubscription:
    """Reads the messages of a topic as bytes, with both time stamps and the publication number.

    An executor that wakes up for every message costs eight times what it costs to empty the queue
    now and then, and does not tell the stamps. The middleware's queue, as deep as the QoS says, is
    read directly here, so the executor does not know of this subscription at all.
    """

    def __init__(self, node: Node, kind: type, topic: str, qos: QoSProfile) -> None:
        check_for_type_support(kind)
        self._kind = kind
        self.qos = qos
        with node.handle:
            self._handle = rclpy_implementation.Subscription(
                node.handle, kind, topic, qos.get_c_qos_profile()
            )
        self.topic: str = self._handle.get_topic_name()

    def take(self) -> list[tuple[bytes, dict[str, int]]]:
        """Return all waiting messages, each with the middleware's information on it."""
        taken = []
        take_one = self._handle.take_message
        kind = self._kind
        while (message := take_one(kind, True)) is not None:
            taken.append(message)
        return taken

    def count_publishers(self) -> int:
        """How many publishers are connected."""
        return int(self._handle.get_publisher_count())

    def close(self) -> None:
        """Leave the topic."""
        self._handle.destroy_when_not_in_use()

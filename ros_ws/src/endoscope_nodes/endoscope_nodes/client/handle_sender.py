"""Speaks for a handle: where it is, and whether its clutch is held."""

from collections.abc import Sequence

from rclpy.duration import Duration
from rclpy.node import Node
from sensor_msgs.msg import Joy

from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MASTER_MEASURED
from endoscope_nodes.runtime.qos import EVENT, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher

CLUTCH_PERIOD_NS = 100_000_000
_RECEIVED = Duration(seconds=0.5)


def handle_senders(node: Node) -> list[str]:
    """Names of all nodes that publish the handle topics, sorted; two of them would be a fault."""
    places = [node.resolve_topic_name(name) for name in (MASTER_MEASURED, MASTER_CLUTCH)]
    found = [info for place in places for info in node.get_publishers_info_by_topic(place)]
    return sorted({info.node_name for info in found})


def clutch_message(held: bool, stamp_ns: int) -> Joy:
    """Say whether the clutch is held."""
    message = Joy(buttons=[int(held)])
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp_ns, 1_000_000_000)
    return message


class HandleSender:
    """The one sender of ``master/measured_js`` and ``master/clutch``, in whichever thread."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._angles = JointPublisher(node, MASTER_MEASURED, JOINTS, ('position',), SENSOR_OFFERED)
        self._clutch = node.create_publisher(Joy, MASTER_CLUTCH, EVENT)
        self._said_ns = 0
        self.clutch = False  # whether it is held, as last published

    def press(self, held: bool, stamp_ns: int) -> None:
        """Say at once whether the clutch is held; stamped in ns."""
        self.clutch = held
        self._said_ns = stamp_ns
        self._clutch.publish(clutch_message(held, stamp_ns))

    def send(self, stamp_ns: int, position: Sequence[float]) -> None:
        """Say where the handle is, in rad, and ten times a second whether the clutch is held."""
        self._angles.publish(stamp_ns, *position)
        if stamp_ns - self._said_ns >= CLUTCH_PERIOD_NS:
            self.press(self.clutch, stamp_ns)

    def close(self) -> None:
        """Leave both topics to another sender, once the last word has been received."""
        self._clutch.wait_for_all_acked(_RECEIVED)
        self._angles.close()
        self._node.destroy_publisher(self._clutch)

"""Lets a node know whether the operator holds the clutch."""

from rclpy.node import Node
from sensor_msgs.msg import Joy

from endoscope_nodes.names import MASTER_CLUTCH
from endoscope_nodes.qos import EVENT
from endoscope_nodes.ticker import Ticker

# The clutch is repeated at 10 Hz; three missed repetitions mean that the console is gone.
CLUTCH_TIMEOUT_NS = 350_000_000


class ClutchWatch:
    """The clutch as last heard; silence counts as released."""

    def __init__(self, node: Node, ticker: Ticker) -> None:
        self._ticker = ticker
        self._pressed = False
        self._heard_ns = 0
        node.create_subscription(Joy, MASTER_CLUTCH, self._receive, EVENT)

    def _receive(self, message: Joy) -> None:
        self._pressed = bool(message.buttons) and message.buttons[0] == 1
        self._heard_ns = self._ticker.monotonic_ns()

    @property
    def held(self) -> bool:
        """Whether the clutch is held now, and was heard of lately."""
        return self._pressed and self._ticker.monotonic_ns() - self._heard_ns <= CLUTCH_TIMEOUT_NS

"""Whether a topic is alive, at the price of a few microseconds a message."""

from rclpy.node import Node
from rclpy.qos import QoSProfile

from endoscope_nodes.ticker import Ticker


class StreamWatch:
    """Notes when a topic was heard last, without reading its messages.

    Parameters
    ----------
    kind
        Message type of the topic.
    """

    def __init__(self, node: Node, ticker: Ticker, kind: type, topic: str, qos: QoSProfile) -> None:
        self.topic = topic
        self._ticker = ticker
        self._heard_ns: int | None = None
        node.create_subscription(kind, topic, self.note, qos, raw=True)

    def note(self, _: bytes) -> None:
        """Take a message as heard now."""
        self._heard_ns = self._ticker.monotonic_ns()

    def trouble(self, timeout_ns: int) -> str:
        """Say what is wrong with the stream; empty if it was heard within ``timeout_ns``."""
        if self._heard_ns is None:
            return f'{self.topic} has not been received'
        age = self._ticker.monotonic_ns() - self._heard_ns
        if age > timeout_ns:
            return f'{self.topic} has been silent for {age * 1e-6:.0f} ms'
        return ''

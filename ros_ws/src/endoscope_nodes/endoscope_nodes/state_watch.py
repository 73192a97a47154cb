"""Lets a node know whether the slave may move."""

from collections.abc import Callable

from rclpy.node import Node
from std_msgs.msg import String

from endoscope_core.safety import OperatingState
from endoscope_nodes.names import OPERATING_STATE
from endoscope_nodes.qos import RESULT
from endoscope_nodes.ticker import Ticker

# The supervisor repeats the state every second; three missed repetitions mean that it is gone.
SILENCE_NS = 3_500_000_000


class StateWatch:
    """The operating state as last heard; unknown counts as not enabled.

    Parameters
    ----------
    on_change
        Called with the new state after each change.

    Attributes
    ----------
    interrupted
        Whether a supervisor that had fallen silent came back with ``ENABLED``, which nobody has
        asked for since: true until it says another state.
    """

    def __init__(
        self, node: Node, ticker: Ticker, on_change: Callable[[OperatingState], None] | None = None
    ) -> None:
        self._node = node
        self._ticker = ticker
        self._on_change = on_change
        self._heard_ns = 0
        self.state = OperatingState.DISABLED
        self.interrupted = False
        node.create_subscription(String, OPERATING_STATE, self._receive, RESULT)

    def _receive(self, message: String) -> None:
        try:
            state = OperatingState(message.data)
        except ValueError:
            self._node.get_logger().error(
                f"'{message.data}' on {OPERATING_STATE} is no operating state: taken as FAULT"
            )
            state = OperatingState.FAULT
        silent = not self.enabled
        self._heard_ns = self._ticker.monotonic_ns()
        self.interrupted = state is self.state is OperatingState.ENABLED and (
            self.interrupted or silent
        )
        if state != self.state:
            self.state = state
            if self._on_change is not None:
                self._on_change(state)

    @property
    def enabled(self) -> bool:
        """Whether motion is allowed now: enabled, and the supervisor alive."""
        return self.state is OperatingState.ENABLED and (
            self._ticker.monotonic_ns() - self._heard_ns < SILENCE_NS
        )

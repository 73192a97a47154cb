"""The clutch, without which nobody moves the slave."""

from collections.abc import Callable

from sensor_msgs.msg import Joy

from endoscope_nodes.names import MASTER_CLUTCH
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.qos import EVENT
from endoscope_nodes.safety.sessions import SessionWatch

# The clutch is repeated at 10 Hz; three missed repetitions mean that the console is gone.
CLUTCH_TIMEOUT_NS = 350_000_000


class ClutchWatch:
    """The clutch as last heard; silence counts as released.

    A second sender ends the node's part in the session, and the clutch counts as released until it
    is let go of: who held it is not known. `on_release` also comes when it is heard again.
    """

    def __init__(
        self,
        node: EndoscopeNode,
        session: SessionWatch,
        on_release: Callable[[], None] | None = None,
    ) -> None:
        self._ticker = node.ticker
        self._session = session
        self._on_release = on_release
        self._pressed = self._doubted = False
        self._heard_ns = 0
        subscription = node.create_subscription(Joy, MASTER_CLUTCH, self._receive, EVENT)
        self._senders = session.senders_of(subscription, self._doubt)

    def _doubt(self, crowd: str) -> None:
        self._doubted = True
        self._pressed = False
        self._session.leave(crowd)

    def _receive(self, message: Joy) -> None:
        crowd = self._senders.rivals()
        if crowd:
            self._doubt(crowd)
            return
        before = self._pressed
        pressed = bool(message.buttons) and message.buttons[0] == 1
        self._doubted = self._doubted and pressed
        pressed = pressed and not self._doubted
        if before and not (pressed and self.held) and self._on_release is not None:
            self._on_release()
        self._pressed = pressed
        self._heard_ns = self._ticker.hand_ns()

    @property
    def held(self) -> bool:
        """Whether the clutch is held now, and was heard of lately."""
        return self._pressed and self._ticker.hand_ns() - self._heard_ns <= CLUTCH_TIMEOUT_NS

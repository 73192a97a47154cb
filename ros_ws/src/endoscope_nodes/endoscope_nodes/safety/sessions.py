"""A node's part in the motion sessions of the supervisor."""

from collections.abc import Callable

from rclpy.subscription import Subscription
from std_msgs.msg import Header

from endoscope_core.safety import CommandGate, MotionSession
from endoscope_nodes.names import MOTION_SESSION
from endoscope_nodes.runtime.diagnostics import ERROR, OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.qos import EVENT
from endoscope_nodes.safety.senders import SenderWatch

SESSION_REPORT = 'motion session'
TURN_S = 0.04


class SessionWatch:
    """A node's part in the motion sessions of the supervisor, told on `/diagnostics`."""

    def __init__(
        self,
        node: EndoscopeNode,
        on_enter: Callable[[], None] | None = None,
        on_leave: Callable[[], None] | None = None,
        session: MotionSession | None = None,
    ) -> None:
        self._node = node
        self._session = session or MotionSession()
        self._on_enter = on_enter
        self._on_leave = on_leave
        self._told = ('', '')
        self._streams: list[tuple[SenderWatch, Callable[[str], None]]] = []
        self._gates: list[tuple[str, CommandGate]] = []
        heartbeat = node.create_subscription(Header, MOTION_SESSION, self._hear, EVENT)
        self._supervisors = SenderWatch(node, heartbeat)
        node.diagnostics.add(SESSION_REPORT, self._report)
        node.ticker.every(TURN_S, self._watch)

    @property
    def name(self) -> str:
        """Session that the node takes part in; empty while it must not move anything."""
        return self._session.name

    def senders_of(
        self, subscription: Subscription, on_crowd: Callable[[str], None] | None = None
    ) -> SenderWatch:
        """Watch who sends on a topic: a second one ends the node's part, by `on_crowd` if given."""
        senders = SenderWatch(self._node, subscription)
        self._streams.append((senders, on_crowd or self.leave))
        return senders

    def obeys(self, topic: str, gate: CommandGate) -> None:
        """End the node's part where a gate refuses what comes on a topic rather than obey it."""
        self._gates.append((topic, gate))

    def _watch(self) -> None:
        self.turn()
        for topic, gate in self._gates:
            if self.name and gate.unheeded:
                self.leave(f'{topic}: {gate.unheeded}')
        for senders, on_crowd in self._streams:
            crowd = senders.rivals()
            if crowd:
                on_crowd(crowd)

    def belongs(self, session: str) -> bool:
        """Whether a message that names this session is of the one that the node takes part in."""
        # After a standstill a message may come before the next turn does.
        self.turn()
        return self._session.belongs(session)

    def leave(self, reason: str) -> None:
        """End the node's part in the session, and say so at once: the slave goes to FAULT."""
        self._session.leave(reason)
        self.tell()

    def turn(self) -> None:
        """Take a turn of the node's loop; a node that beats calls this more often."""
        self._session.beat(self._node.ticker.monotonic_ns())
        self.tell()

    def _hear(self, message: Header) -> None:
        doubt = self._supervisors.rivals()
        now = self._node.ticker.monotonic_ns()
        if self._session.hear(message.frame_id, now, doubt):
            self._told = (self._session.name, '')
            if self._on_enter is not None:
                self._on_enter()
            return
        self.tell()

    def tell(self) -> None:
        """Say how the node's part in the session has changed, if it has."""
        told = (self._session.name, self._session.trouble)
        if told == self._told:
            return
        before, self._told = self._told, told
        if before[0] and not told[0] and self._on_leave is not None:
            self._on_leave()
        if told[1]:
            self._node.get_logger().error(told[1])
        self._node.diagnostics.publish()

    def _report(self) -> Report:
        session = self._session
        return (ERROR, session.trouble, {}) if session.trouble else (OK, session.name or 'none', {})

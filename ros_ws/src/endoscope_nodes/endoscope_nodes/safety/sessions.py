"""Who may move the slave: a node's part in the motion sessions, the one sender, the clutch."""

from collections.abc import Callable

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.subscription import Subscription
from sensor_msgs.msg import Joy
from std_msgs.msg import Header

from endoscope_core.safety import CommandGate, MotionSession, Refusal
from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MOTION_SESSION
from endoscope_nodes.runtime.diagnostics import ERROR, OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT
from endoscope_nodes.runtime.streams import JointSample, JointSubscription

SESSION_REPORT = 'motion session'
TURN_S = 0.04
# The clutch is repeated at 10 Hz; three missed repetitions mean that its sender is gone.
CLUTCH_TIMEOUT_NS = 350_000_000


class SenderWatch:
    """Whether a topic has had but one sender since this was last asked.

    A message may wait for a node that is not run and outlive its sender, which is not among those
    who are there when it is taken.  A node killed without a last word counts until the middleware
    has given it up.
    """

    def __init__(self, node: EndoscopeNode, subscription: Subscription) -> None:
        self._node = node
        self._topic = subscription.topic_name
        self._event = node.matched_event(subscription)
        self._there = self._ever = 0

    def rivals(self) -> str:
        """Say who else has been there; empty while there was but one."""
        matched = self._event.take_event()
        been = self._there + matched.total_count - self._ever
        self._there, self._ever = matched.current_count, matched.total_count
        if been <= 1:
            return ''
        relative = self._topic.removeprefix(f'{self._node.get_namespace()}/')
        known = senders_in_words(self._node, self._topic)
        return known or f'{relative} had {been} senders, not all of which are still there'


def senders_in_words(node: EndoscopeNode, topic: str) -> str:
    """Name all senders of a topic in one line; empty where there are fewer than two."""
    known = [
        f'{info.node_namespace.rstrip("/")}/{info.node_name}'
        for info in node.get_publishers_info_by_topic(topic)
    ]
    if len(known) < 2:
        return ''
    relative = topic.removeprefix(f'{node.get_namespace()}/')
    return f'{relative} has {len(known)} senders: {" and ".join(sorted(known))}'


class SessionWatch:
    """A node's part in the motion sessions of the supervisor, reported on `/diagnostics`."""

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
        self._published = ('', '')
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
        self, subscription: Subscription, on_rivals: Callable[[str], None] | None = None
    ) -> SenderWatch:
        """Watch who sends on a topic: a second one ends the node's part, by `on_rivals`."""
        senders = SenderWatch(self._node, subscription)
        self._streams.append((senders, on_rivals or self.leave))
        return senders

    def one_sender[T](
        self,
        subscribe: Callable[[Callable[[T], None]], Subscription],
        take: Callable[[T], None],
        on_competing: Callable[[str], None] | None = None,
    ) -> None:
        """Give `take` what `subscribe` hears while it has one sender; see :meth:`senders_of`."""
        otherwise = on_competing or self.leave

        def receive(message: T) -> None:
            competing = senders.rivals()
            if competing:
                otherwise(competing)
            else:
                take(message)

        senders = self.senders_of(subscribe(receive), otherwise)

    def results(
        self,
        topic: str,
        take: Callable[[DiagnosticArray], None],
        on_competing: Callable[[str], None] | None = None,
    ) -> None:
        """Give `take` the results on a latched topic while it has one sender."""
        self.one_sender(
            lambda receive: self._node.create_subscription(DiagnosticArray, topic, receive, RESULT),
            take,
            on_competing,
        )

    def commands(
        self,
        topic: str,
        gate: CommandGate,
        take: Callable[[JointSample], None],
        obeys: bool = False,
    ) -> None:
        """Give `take` the commands of joints of the open session, while they have one sender.

        With `obeys`, see there, too.
        """

        def receive(sample: JointSample) -> None:
            if not self.belongs(sample.session):
                gate.refuse(Refusal.SESSION, sample.session or 'none named')
                return
            competing = senders.rivals()
            if competing:
                gate.refuse(Refusal.SENDER, competing)
                self.leave(competing)
                return
            take(sample)

        stream = JointSubscription(
            self._node,
            topic,
            JOINTS,
            receive,
            COMMAND,
            exact=True,
            on_malformed=lambda reason: gate.refuse(Refusal.MALFORMED, reason),
        )
        senders = self.senders_of(stream.subscription)
        if obeys:
            self.obeys(topic, gate)

    def obeys(self, topic: str, gate: CommandGate) -> None:
        """End the node's part where a gate refuses what comes on a topic rather than obey it."""
        self._gates.append((topic, gate))

    def _watch(self) -> None:
        self.turn()
        for topic, gate in self._gates:
            if self.name and gate.unheeded:
                self.leave(f'{topic}: {gate.unheeded}')
        for senders, on_rivals in self._streams:
            rivals = senders.rivals()
            if rivals:
                on_rivals(rivals)

    def belongs(self, session: str) -> bool:
        """Whether a message that names this session is of the one that the node takes part in."""
        # After a standstill a message may come before the next turn does.
        self.turn()
        return self._session.belongs(session)

    def leave(self, reason: str) -> None:
        """End the node's part in the session, and say so at once: the slave goes to FAULT."""
        self._session.leave(reason)
        self.publish()

    def turn(self) -> None:
        """Take a turn of the node's loop; a node that beats calls this more often."""
        self._session.beat(self._node.ticker.monotonic_ns())
        self.publish()

    def _hear(self, message: Header) -> None:
        doubt = self._supervisors.rivals()
        now = self._node.ticker.monotonic_ns()
        if self._session.hear(message.frame_id, now, doubt):
            if self._published[0]:
                self._node.end_session()
            self._published = (self._session.name, '')
            if self._on_enter is not None:
                self._on_enter()
            return
        self.publish()

    def publish(self) -> None:
        """Say how the node's part in the session has changed, if it has."""
        state = (self._session.name, self._session.trouble)
        if state == self._published:
            return
        before, self._published = self._published, state
        if before[0] and not state[0]:
            if self._on_leave is not None:
                self._on_leave()
            self._node.end_session()
        if state[1]:
            self._node.get_logger().error(state[1])
        self._node.diagnostics.publish()

    def _report(self) -> Report:
        session = self._session
        return (ERROR, session.trouble, {}) if session.trouble else (OK, session.name or 'none', {})


class ClutchWatch:
    """The clutch as last heard; silence counts as released.

    A second sender ends the node's part in the session, and the clutch is treated as released
    until it is released: who held it is not known. `on_release` also comes when it is heard again.
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
        session.one_sender(
            lambda receive: node.create_subscription(Joy, MASTER_CLUTCH, receive, EVENT),
            self._receive,
            self._doubt,
        )

    def _doubt(self, rivals: str) -> None:
        self._doubted = True
        self._pressed = False
        self._session.leave(rivals)

    def _receive(self, message: Joy) -> None:
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

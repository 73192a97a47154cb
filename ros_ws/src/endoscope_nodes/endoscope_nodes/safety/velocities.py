"""Velocities that another program commands: whether it is the one sender of motion."""

from collections.abc import Callable

from geometry_msgs.msg import TwistStamped

from endoscope_core.control.velocity_stream import VelocityStream
from endoscope_core.kinematics import TipVelocity
from endoscope_core.safety import Refusal
from endoscope_nodes.names import JOINTS, MASTER_NODE, SLAVE_COMMAND, SLAVE_VELOCITY, TIP_VELOCITY
from endoscope_nodes.runtime.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.qos import COMMAND
from endoscope_nodes.runtime.streams import JointSample, JointSubscription
from endoscope_nodes.safety.sessions import TURN_S, SessionWatch

_VELOCITIES = (SLAVE_VELOCITY, TIP_VELOCITY)


def rivals_in_motion(node: EndoscopeNode) -> str:
    """Name all senders of positions and velocities, if several besides the master."""
    if not any(map(node.count_publishers, _VELOCITIES)):
        return ''
    master = MASTER_NODE, node.get_namespace()
    senders = [
        f'{info.node_namespace.rstrip("/")}/{info.node_name} of {topic}'
        for topic in (SLAVE_COMMAND, *_VELOCITIES)
        for info in node.get_publishers_info_by_topic(node.resolve_topic_name(topic))
        if topic != SLAVE_COMMAND or (info.node_name, info.node_namespace) != master
    ]
    return f'motion has {len(senders)} senders: {" and ".join(senders)}' * (len(senders) > 1)


class VelocityCommands:
    """Gives a stream the velocities on both topics, of one sender in the open motion session.

    A second sender of motion ends the node's part in the session. `held` says whether the clutch
    is, `where` how far the slave is bent, (J,) in rad, and `other` who else moves it, in words.
    """

    def __init__(
        self,
        node: EndoscopeNode,
        session: SessionWatch,
        stream: VelocityStream,
        held: Callable[[], bool],
        where: Callable[[], tuple[float, ...] | None],
        other: Callable[[], str],
    ) -> None:
        self._node, self._session, self._stream = node, session, stream
        self._held, self._where, self._other = held, where, other
        self.topic, self.heard_ns = SLAVE_VELOCITY, 0  # of the last message; by a hand's time
        self._reported = self._without_clutch = self._accepted = 0
        rates = JointSubscription(
            node,
            SLAVE_VELOCITY,
            JOINTS,
            self._on_rates,
            COMMAND,
            exact=True,
            on_malformed=lambda reason: stream.gate.refuse(Refusal.MALFORMED, reason),
        )
        tips = node.create_subscription(TwistStamped, TIP_VELOCITY, self._on_tip, COMMAND)
        self._events = [node.matched_event(s) for s in (rates.subscription, tips)]
        self._there, self._ever = [0, 0], [0, 0]
        session.obeys(' and '.join(_VELOCITIES), stream.gate)
        node.diagnostics.add('velocities', self._report)
        node.ticker.every(TURN_S, self._watch)

    @property
    def alone(self) -> bool:
        """Whether there is one sender of velocities, and nobody else who moves the slave."""
        return sum(self._there) == 1 and not self._other() and not rivals_in_motion(self._node)

    def _rivals(self) -> str:
        """Say who else has been there since this was last asked; see :class:`SenderWatch`."""
        been = 0
        for k, event in enumerate(self._events):
            matched = event.take_event()
            been += self._there[k] + matched.total_count - self._ever[k]
            self._there[k], self._ever[k] = matched.current_count, matched.total_count
        if been > 1:
            words = f'velocities had {been} senders, not all of which are still there'
            return rivals_in_motion(self._node) or words
        return self._other() if been else ''

    def _watch(self) -> None:
        rivals = self._rivals() or (sum(self._there) and rivals_in_motion(self._node))
        if rivals:
            self._session.leave(rivals)

    def _on_rates(self, sample: JointSample) -> None:
        gate, rates = self._stream.gate, sample.velocity
        if not self._may_command(SLAVE_VELOCITY, sample.session):
            return
        if len(rates) != len(JOINTS):
            gate.refuse(Refusal.MALFORMED, f'{len(rates)} velocities')
            return
        self._stream.take(sample.stamp_ns, rates, self._node.ticker.monotonic_ns())

    def _on_tip(self, message: TwistStamped) -> None:
        header, linear, angular = message.header, message.twist.linear, message.twist.angular
        if self._may_command(TIP_VELOCITY, header.frame_id):
            stamp_ns = header.stamp.sec * 1_000_000_000 + header.stamp.nanosec
            asked = TipVelocity((linear.x, linear.y, linear.z), (angular.x, angular.y, angular.z))
            now = self._node.ticker.monotonic_ns()
            self._stream.take_tip(stamp_ns, asked, now, self._where())

    def _may_command(self, topic: str, session: str) -> bool:
        """Whether a message that names a session may be obeyed; it is refused if not."""
        gate = self._stream.gate
        if not self._session.belongs(session):
            gate.refuse(Refusal.SESSION, session or 'none named')
            return False
        rivals = self._rivals()
        if rivals:
            gate.refuse(Refusal.SENDER, rivals)
            self._session.leave(rivals)
            return False
        if not self._held():
            gate.refuse(Refusal.CLUTCH)
            return False
        self.topic, self.heard_ns = topic, self._node.ticker.hand_ns()
        return True

    def _report(self) -> Report:
        gate, ignored = self._stream.gate, self._stream.ignored
        values: dict[str, object] = {'accepted': gate.accepted, 'ignored': ignored}
        values |= {f'refused: {reason}': count for reason, count in gate.refused.items()}
        total, idle = sum(gate.refused.values()), gate.refused[Refusal.CLUTCH]
        refused, unheeded = total - self._reported, idle - self._without_clutch
        obeyed = gate.accepted - self._accepted
        self._reported, self._without_clutch, self._accepted = total, idle, gate.accepted
        if refused:
            text = f'{refused} of {refused + obeyed} velocities refused, last: {gate.last_reason}'
            return ERROR if refused - unheeded > obeyed else WARN, text, values
        if ignored:
            return WARN, f'ignored, for the tip bends by two angles: {ignored}', values
        return OK, 'velocities in order' if obeyed else 'nobody commands velocities', values

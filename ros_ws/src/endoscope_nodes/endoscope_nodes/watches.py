"""What a node watches to know whether it may move the slave: session, senders, clutch, streams."""

import math
import os
import struct
from collections.abc import Callable

from rclpy.subscription import Subscription
from sensor_msgs.msg import JointState, Joy
from std_msgs.msg import Header

from endoscope_bags.errors import MalformedMessageError
from endoscope_core.safety import CommandGate, MotionSession, Refusal
from endoscope_nodes.diagnostics import ERROR, OK, WARN, Report
from endoscope_nodes.endoscope_node import EndoscopeNode
from endoscope_nodes.joint_stream import JointReader, JointSample
from endoscope_nodes.names import (
    JOINTS,
    MASTER_CLUTCH,
    MOTION_SESSION,
    MOTOR_MEASURED,
    MOTORS,
    SLAVE_MEASURED,
)
from endoscope_nodes.qos import EVENT, SENSOR_ASKED
from endoscope_nodes.ticker import Ticker

SESSION_REPORT = 'motion session'
TURN_S = 0.04
_STAMP = struct.Struct('<iI')
_STAMP_END = 12
_CARRIED = 0.99
_HALF = 0.5
_STARVED_REPORTS = 2

# The clutch is repeated at 10 Hz; three missed repetitions mean that the console is gone.
CLUTCH_TIMEOUT_NS = 350_000_000
# At 40 Hz, three missed frames mean that the tracker has lost its sensor.
TRACKER_TIMEOUT_NS = 100_000_000


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
        return known or f'{relative} had {been} senders, of which not all are there any more'


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


class StreamWatch:
    """Whether a topic is alive, as far as this process listened to it."""

    def __init__(self, ticker: Ticker, topic: str) -> None:
        self.topic = topic  # name for its troubles
        self._ticker = ticker
        self._heard_ns: int | None = None
        self._late_ns = 0

    def note(self, _: object = None) -> None:
        """Take the topic as heard now; fit to be the callback of a raw subscription."""
        self._heard_ns = self._ticker.monotonic_ns()
        self._late_ns = self._ticker.late_ns

    @property
    def ever_heard(self) -> bool:
        """Whether the stream was heard at all."""
        return self._heard_ns is not None

    def heard(self, timeout_ns: int) -> bool:
        """Whether the stream was heard within ``timeout_ns``."""
        if self._heard_ns is None:
            return False
        age = self._ticker.monotonic_ns() - self._heard_ns
        # A loop that came late has heard nothing meanwhile: its delay is not taken for silence, up
        # to once the time allowed.
        return age - min(self._ticker.late_ns - self._late_ns, timeout_ns) <= timeout_ns

    def trouble(self, timeout_ns: int) -> str:
        """Say what is wrong with the stream; empty if it was heard within ``timeout_ns``."""
        if self.heard(timeout_ns):
            return ''
        if self._heard_ns is None:
            return f'{self.topic} has not been received'
        age = self._ticker.monotonic_ns() - self._heard_ns
        deaf = self._ticker.late_ns - self._late_ns
        late = f', {deaf * 1e-6:.0f} ms of which this process was not run itself' if deaf else ''
        return f'{self.topic} has been silent for {age * 1e-6:.0f} ms{late}'


class MeasuredPose:
    """Where shafts and bending section are: what whoever enters a session starts from.

    One serves all nodes of a process, because a subscription of each node's own would cost more
    than most nodes do; `listen` lets another of them host the subscriptions.
    """

    def __init__(self, node: EndoscopeNode) -> None:
        self._ticker = node.ticker
        self._gear = node.rig.joints.gear
        self._timeout_ns = node.rig.timeouts.stream_ns
        self._shafts_reader = JointReader(MOTORS)
        self._shafts = b''
        self._shafts_stamp = (0, 0)
        self.shafts_ns = 0  # when the newest shaft angles came, monotonic
        self._joints_reader = JointReader(JOINTS)
        self.tracked: JointSample | None = None  # None before the first
        self._tracked_ns = 0
        self.listen(node)

    def listen(self, node: EndoscopeNode) -> None:
        """Subscribe by this node from now on."""
        self.host = node
        node.create_subscription(
            JointState, MOTOR_MEASURED, self._keep_shafts, SENSOR_ASKED, raw=True
        )
        node.create_subscription(
            JointState, SLAVE_MEASURED, self._keep_bending, SENSOR_ASKED, raw=True
        )

    def _keep_shafts(self, data: bytes) -> None:
        # A writer that is killed while it writes may leave a torn message behind, stamped zero.
        if len(data) < _STAMP_END:
            return
        now, stamp = self._ticker.monotonic_ns(), _STAMP.unpack_from(data, 4)
        if stamp > self._shafts_stamp or now - self.shafts_ns > self._timeout_ns:
            self._shafts, self._shafts_stamp, self.shafts_ns = data, stamp, now

    def _keep_bending(self, data: bytes) -> None:
        sample = _read(self._joints_reader, data)
        now = self._ticker.monotonic_ns()
        newer = self.tracked is None or (
            sample is not None and sample.stamp_ns > self.tracked.stamp_ns
        )
        if sample is not None and (newer or now - self._tracked_ns > TRACKER_TIMEOUT_NS):
            self.tracked, self._tracked_ns = sample, now

    def shafts(self) -> tuple[float, ...] | None:
        """Shaft angles in rad, shape (J,); None while none were read lately."""
        if not self._shafts or self._silent(self.shafts_ns, self._timeout_ns):
            return None
        sample = _read(self._shafts_reader, self._shafts)
        return None if sample is None else sample.position

    @property
    def tracks(self) -> bool:
        """Whether the tracker was heard lately."""
        return self.tracked is not None and not self._silent(self._tracked_ns, TRACKER_TIMEOUT_NS)

    def bending(self) -> tuple[float, ...] | None:
        """Bending angles in rad, shape (J,); None while neither tracker nor shafts are known."""
        if self.tracked is not None and self.tracks:
            return self.tracked.position
        # What the shafts would have bent it to without any loss.
        shafts = self.shafts()
        return None if shafts is None else tuple(x / self._gear for x in shafts)

    def _silent(self, heard_ns: int, timeout_ns: int) -> bool:
        return self._ticker.monotonic_ns() - heard_ns > timeout_ns


def _read(reader: JointReader, data: bytes) -> JointSample | None:
    try:
        sample = reader.read(data)
    except MalformedMessageError:
        return None
    return sample if sample.position and all(map(math.isfinite, sample.position)) else None


def _who_starves(late_ns: int) -> str:
    load, cores = os.getloadavg()[0], os.cpu_count()
    who = (
        f'this process was not run for {late_ns * 1e-6:.0f} ms'
        if late_ns
        else 'this process was run in time, so the sender was not'
    )
    return (
        f'{who} (load {load:.1f} on {cores} cores); realtime_priority puts the nodes before other '
        'programs, and `graph --check` says which tick_rate is carried'
    )


class CommandReport:
    """What a command gate did, as a diagnostic report; lost commands are told with what helps."""

    def __init__(
        self,
        gate: CommandGate,
        ticker: Ticker,
        on_starved: Callable[[str], None] | None = None,
    ) -> None:
        self._gate = gate
        self._ticker = ticker
        self._late_ns = 0
        self._on_starved = on_starved
        self._reported = self._without_clutch = 0
        self._accepted = 0
        self._due = 0.0
        self._starved = 0

    def __call__(self) -> Report:
        """Report counts; a warning if anything was refused or lost since the last report."""
        gate = self._gate
        values: dict[str, object] = {'accepted': gate.accepted}
        values |= {f'refused: {reason}': count for reason, count in gate.refused.items()}
        total = sum(gate.refused.values())
        # Told from old ones, so that a warning ends when its cause does.
        fresh, self._reported = total - self._reported, total
        idle = gate.refused[Refusal.CLUTCH]
        # Not counting what comes while the clutch is not held.
        unheeded = fresh - (idle - self._without_clutch)
        self._without_clutch = idle
        accepted, self._accepted = gate.accepted - self._accepted, gate.accepted
        due, self._due = gate.due - self._due, gate.due
        share = accepted / due if due else 1.0
        values['carried [%]'] = 100.0 * share
        self._starved = self._starved + 1 if share < _HALF else 0
        late_ns, self._late_ns = self._ticker.late_ns - self._late_ns, self._ticker.late_ns
        # The hop that starves is the first whose share is low.
        starved = f'{100.0 * share:.0f} % of {due:.0f} commands arrive: {_who_starves(late_ns)}'
        # A rate of which a half would be carried better.
        if self._starved >= _STARVED_REPORTS and self._on_starved is not None:
            self._on_starved(starved)
        if fresh:
            said = f'{fresh} of {fresh + accepted} commands refused, last: {gate.last_reason}'
            # Whoever sends what is not obeyed believes that he moves something.
            return ERROR if unheeded > accepted else WARN, said, values
        if share < _CARRIED:
            return WARN, starved, values
        return OK, 'commands in order', values

"""Hears what a running graph says of itself."""

import math
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from std_msgs.msg import Header, String

from endoscope_core.calibration.calibration_run import OrderFeedback, OrderState
from endoscope_core.errors import EndoscopeError
from endoscope_core.exit_status import ClosedOnExit
from endoscope_nodes import names
from endoscope_nodes.runtime.diagnostics import (
    ERROR,
    OK,
    diagnostic_array,
    from_status,
    status,
    texts_of,
)
from endoscope_nodes.runtime.qos import profile
from endoscope_nodes.runtime.streams import RawSubscription
from endoscope_nodes.topics import Qos

PATIENCE_S = 20.0
POLL_S = 0.05
SUPERVISOR = 'supervisor: operating state'
RECORDER = 'recorder: recording'
EVENTS = 'recorder: events'
WATCH = 'watch: rig'
MASTER = f'{names.MASTER_NODE}: commands'
LOCK_STEP = f'{names.CLOCK_NODE}: lock-step'
COMMANDS = (
    'master: velocities',
    'compensator: commands',
    'compensator: calibration commands',
    'motor_driver: commands',
)
# A loop that reads as seldom as this still hears every word.
_HEARD = profile(Qos(200))
_HEARD_LATCHED = profile(Qos(200, latched=True))


class GraphError(EndoscopeError):
    """Nobody answers, or the graph refused what was asked of it or did not do it in time."""


@dataclass(frozen=True)
class Health:
    """What a node last reported of a part of itself on ``/diagnostics``, or of a result."""

    level: int  # 0 for good health, 1 for a warning, 2 for an error
    message: str
    values: dict[str, str]
    stamp_ns: int  # of the report, by the graph's clock
    received_ns: int  # heard, by this machine's clock
    session: str = ''  # motion session that it is of, for results


class GraphListener(ClosedOnExit):
    """Listens to a graph while it waits for something, in which `serve` serves the node."""

    def __init__(
        self,
        node: Node,
        serve: Callable[[float], object],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.node = node
        self.serve = serve
        self._clock = clock
        self.state = self.session = ''  # as last heard, empty before
        # State and open session last heard; the supervisor's time when it last spoke, 0 before.
        self.state_ns = self.open_ns = self.graph_ns = 0
        # By status without the namespace: ``supervisor: operating state``.
        self.health: dict[str, Health] = {}
        self.heard_ns: dict[str, int] = {}  # each node on ``/diagnostics``
        self.calibration: Health | None = None  # last result; None before the first
        self.compensator: Health | None = None  # model in force; None before the first
        # By id, how each order to calibrate or to go home has fared; empty until calibration is
        # heard.
        self.orders: dict[int, OrderFeedback] = {}
        self._prefix = f'{node.get_namespace().rstrip("/")}/'
        self._heard: list[tuple[RawSubscription, Callable[[bytes, int], object]]] = []
        self.listen(String, names.OPERATING_STATE, self._on_state, latched=True)
        self.listen(Header, names.MOTION_SESSION, self._on_session)
        self.listen(DiagnosticArray, names.DIAGNOSTICS, self._on_health)
        self.listen(DiagnosticArray, names.CALIBRATION_FEEDBACK, self._on_feedback, latched=True)
        self.listen(DiagnosticArray, names.CALIBRATION_RESULT, self._on_result, latched=True)
        self.listen(DiagnosticArray, names.COMPENSATOR_STATE, self._on_model, latched=True)

    def listen(
        self,
        kind: type,
        topic: str,
        take: Callable[[bytes, int], object],
        *,
        latched: bool = False,
        qos: QoSProfile | None = None,
    ) -> RawSubscription:
        """Hear one more topic: ``take`` gets each message's bytes and its receipt in ns."""
        asked = qos or (_HEARD_LATCHED if latched else _HEARD)
        subscription = RawSubscription(self.node, kind, topic, asked)
        self._heard.append((subscription, take))
        return subscription

    def hear(self) -> None:
        """Take all that has come."""
        for subscription, take in self._heard:
            for data, info in subscription.take():
                take(data, info['received_timestamp'])

    def _on_state(self, data: bytes, received_ns: int) -> None:
        self.state = deserialize_message(data, String).data
        self.state_ns = received_ns

    def _on_session(self, data: bytes, received_ns: int) -> None:
        message = deserialize_message(data, Header)
        self.session, self.graph_ns = message.frame_id, Time.from_msg(message.stamp).nanoseconds
        if self.session:
            self.open_ns = received_ns

    def _on_health(self, data: bytes, received_ns: int) -> None:
        for full_name, health in _healths(data, received_ns).items():
            if full_name.startswith(self._prefix):
                name = full_name.removeprefix(self._prefix)
                self.health[name] = health
                self.heard_ns[name.partition(':')[0]] = received_ns

    def _on_feedback(self, data: bytes, received_ns: int) -> None:
        order = feedback_of(deserialize_message(data, DiagnosticArray))
        if order.state == OrderState.WAITING:
            # Calibration restarts, and its time may too.
            self.orders.clear()
        self.orders[order.id] = order

    def _on_result(self, data: bytes, received_ns: int) -> None:
        self.calibration = next(iter(_healths(data, received_ns).values()), self.calibration)

    def _on_model(self, data: bytes, received_ns: int) -> None:
        self.compensator = next(iter(_healths(data, received_ns).values()), self.compensator)

    @property
    def underway(self) -> OrderFeedback | None:
        """The order for which calibration moves the slave now; None for none."""
        orders = list(self.orders.values())
        return next((order for order in orders if order.state == OrderState.EXECUTING), None)

    @property
    def why(self) -> str:
        """Why the supervisor forbids motion; empty where it does not."""
        latest = self.health.get(SUPERVISOR)
        if latest is None:
            return ''
        return latest.values.get('cause') or latest.values.get('present causes', '')

    @property
    def awaited(self) -> str:
        """What the supervisor has never heard and has to hear; empty where the graph is whole."""
        latest = self.health.get(SUPERVISOR)
        return '' if latest is None else latest.values[names.AWAITED]

    @property
    def factor(self) -> float | None:
        """Simulated seconds in a real one, as last reported; None where time is real, or before."""
        latest = self.health.get(LOCK_STEP)
        factor = math.nan if latest is None else float(latest.values[names.FACTOR])
        return factor if math.isfinite(factor) else None

    @property
    def pace(self) -> str:
        """The graph's pace, to be added to a time in its seconds; empty where it is real."""
        factor = self.factor
        return '' if factor is None else f" of the graph's time, at {factor:.2g} of real time"

    @property
    def where(self) -> str:
        """Namespace and domain, in words."""
        namespace = self.node.get_namespace()
        return f'namespace {namespace}, ROS_DOMAIN_ID {self.node.context.get_domain_id()}'

    def nodes(self) -> list[str]:
        """Names of the nodes in the namespace, without this one."""
        own, namespace = self.node.get_name(), self.node.get_namespace()
        found = self.node.get_node_names_and_namespaces()
        return sorted({name for name, space in found if space == namespace and name != own})

    def wait_until(self, condition: Callable[[], bool], patience_s: float = PATIENCE_S) -> bool:
        """Listen until it is true, or for so long by the slower of two clocks; whether it is."""
        begun_s = moved_s = self._clock()
        self.hear()
        graph_ns, passed_ns = self.graph_ns, 0
        while True:
            self.hear()
            if condition():
                return True
            now = self._clock()
            if self.graph_ns != graph_ns:
                # It begins anew with a supervisor that restarts.
                passed_ns += max(0, self.graph_ns - graph_ns) if graph_ns else 0
                graph_ns, moved_s = self.graph_ns, now
            if min(now - begun_s, passed_ns * 1e-9) > patience_s or now - moved_s > patience_s:
                return False
            self.serve(POLL_S)

    def wait_for(
        self, condition: Callable[[], bool], what: str, patience_s: float = PATIENCE_S
    ) -> None:
        """Listen until something has come true; GraphError if it has not within so long."""
        if not self.wait_until(condition, patience_s):
            raise GraphError(f'timed out after {patience_s:g} s{self.pace} waiting for {what}')

    def close(self) -> None:
        """Listen no more; the node remains."""
        for subscription, _ in self._heard:
            subscription.close()


def _healths(data: bytes, received_ns: int) -> dict[str, Health]:
    message = deserialize_message(data, DiagnosticArray)
    stamp_ns = Time.from_msg(message.header.stamp).nanoseconds
    return {
        status.name: Health(
            status.level[0],
            status.message,
            texts_of(status),
            stamp_ns,
            received_ns,
            message.header.frame_id,
        )
        for status in message.status
    }


def feedback_message(feedback: OrderFeedback, stamp_ns: int) -> DiagnosticArray:
    """Write it, at a time in ns."""
    values = asdict(feedback)
    words = values.pop('words')
    level = ERROR if feedback.state in (OrderState.ABORTED, OrderState.REJECTED) else OK
    return diagnostic_array(stamp_ns, status('calibration: order', level, words, values))


def feedback_of(message: DiagnosticArray) -> OrderFeedback:
    """Read it."""
    [order] = message.status
    return from_status(OrderFeedback, order, words=order.message)

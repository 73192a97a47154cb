"""The recorder's part in keeping events: what led to a fault or an operator's mark, as a bag."""

from collections.abc import Callable, Mapping
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message
from std_msgs.msg import String

from endoscope_bags.errors import BagError
from endoscope_bags.event_bag import FAULT, MARK, EventBag, new_event_bag
from endoscope_bags.recent_messages import RecentMessages, packed
from endoscope_bags.recording_session import Arrival, RecordingSession
from endoscope_nodes.client.graph_listener import SUPERVISOR
from endoscope_nodes.names import DIAGNOSTICS, LAST_EVENT, MARKS, RECORDER_MARK
from endoscope_nodes.runtime.diagnostics import ERROR, OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_parameters import RecorderParameters
from endoscope_nodes.runtime.qos import EVENT

_SECOND = 1_000_000_000
_MEGABYTE = 1_000_000
_AFTER_NS = 2 * _SECOND
"""How long the bag of an event goes on after the last of its events."""
_REASON_NS = 1_500_000_000
"""How long the reason of a fault is waited for, which the supervisor tells at once and again every
second."""


class EventKeeping:
    """Keeps the last seconds in memory, for the bag of a fault or of what ``recorder/mark`` says.

    `collect` takes what has arrived by a time, and hands it to `go_on`; `folder` is where the bags
    go, and `open_session` opens one there with metadata records.
    """

    def __init__(
        self,
        node: EndoscopeNode,
        parameters: RecorderParameters,
        *,
        collect: Callable[[int], None],
        folder: Callable[[], Path],
        open_session: Callable[[Path, Mapping[str, dict[str, str]]], RecordingSession],
    ) -> None:
        self._node, self._collect, self._folder = node, collect, folder
        self._open_session = open_session
        self.recent = RecentMessages(parameters.keep, parameters.keep_room * _MEGABYTE)
        self.keeps = parameters.keep > 0.0
        self._most = parameters.keep_bags
        self.event: EventBag | None = None  # whose bag is being written
        self._ends_ns = 0
        self._begins_ns = 0
        self._trouble = ''
        self._marks = 0
        self._last = ''
        self.state = ''  # operating state; empty before the first one is heard
        self._supervisor = f'{node.get_namespace().rstrip("/")}/{SUPERVISOR}'
        self._cause = ''  # of the fault that there is, as the supervisor told last
        if self.keeps:
            node.create_subscription(String, RECORDER_MARK, self._on_mark, EVENT)
            node.create_subscription(
                DiagnosticArray, DIAGNOSTICS, self._on_diagnostics, EVENT, raw=True
            )

    @property
    def session(self) -> RecordingSession | None:
        """Into which an event's bag is written."""
        return self.event.session if self.event else None

    def on_state(self, state: str) -> None:
        """Take the operating state: one that becomes ``FAULT`` is an event."""
        before, self.state = self.state, state
        if self.keeps and before and before != state == 'FAULT':
            # Of state and cause, either may come first.
            self._on_event(FAULT, self._cause)
        if state != 'FAULT':
            self._cause = ''

    def _on_mark(self, message: String) -> None:
        self._marks += 1
        self._on_event(MARK, message.data.strip() or 'by the operator')
        # Whoever asked waits for the answer.
        self._node.diagnostics.publish()

    def _on_diagnostics(self, data: bytes) -> None:
        # One node of a dozen is listened to: reading what the others say takes a hundred times
        # longer.
        if self._supervisor.encode() not in data:
            return
        told: DiagnosticArray = deserialize_message(data, DiagnosticArray)
        for status in told.status:
            if status.name == self._supervisor:
                self._cause = {v.key: v.value for v in status.values}.get('cause', '')
                if self._cause and self.event is not None and self.event.lacks_reason:
                    self.event.explain(self._cause)

    def _on_event(self, kind: str, reason: str = '') -> None:
        """Keep what came before in a bag, or note one more event of the bag that is written."""
        ticker = self._node.ticker
        now_ns, steady_ns = ticker.now_ns(), ticker.monotonic_ns()
        if not now_ns:
            return
        self._ends_ns = steady_ns + _AFTER_NS
        self._begins_ns = steady_ns + _REASON_NS
        if self.event is not None:
            self.event.add(kind, now_ns, reason)
            return
        self._collect(now_ns)
        self.event = EventBag(self.recent, kind, now_ns, reason)
        if reason:
            self._begin(self.event)

    def _begin(self, event: EventBag) -> None:
        try:
            path = new_event_bag(self._folder(), event.kind, self._most)
            event.begin(lambda records: self._open_session(path, records))
        except BagError as error:
            self.event = None
            self._say_trouble(f'no bag of the {event.events[0]}: {error}')
            return
        self._trouble, self._last = '', str(path)
        self._node.get_logger().info(f'{event.events[0]}: what led to it goes to {path}')

    def _say_trouble(self, what: str) -> None:
        self._trouble = what
        self._node.exit_code = 1
        self._node.get_logger().error(what)
        self._node.diagnostics.publish()

    def go_on(self, arrivals: list[Arrival]) -> None:
        """Write what arrived to the bag of an event, where one is written, and end it in time."""
        event = self.event
        if event is None:
            return
        steady_ns = self._node.ticker.monotonic_ns()
        event.arrive(packed(arrivals), len(arrivals))
        if event.session is None:
            if not event.lacks_reason or steady_ns >= self._begins_ns:
                self._begin(event)
            return
        if event.session.full or (steady_ns >= self._ends_ns and event.caught_up):
            self._end()

    def close(self) -> None:
        """Finish the bag that is being written."""
        if self.event is not None:
            self._collect(self._node.ticker.now_ns())
            self._end()

    def _end(self) -> None:
        event, self.event = self.event, None
        if event is None:
            return
        if event.session is None:
            self._begin(event)
            # It is begun to be ended at once, where the node ends.
            self.event = None
        if event.session is None:
            return
        report = event.close()
        if report.full or not report.finished:
            self._say_trouble(f'the bag of the {event.events[0]}: {report}')
        else:
            self._node.get_logger().info(str(report))

    def report(self) -> Report:
        """Say for the diagnostics what is kept and written."""
        values: dict[str, object] = {
            'kept [s]': self.recent.seconds,
            'kept [MB]': self.recent.size / _MEGABYTE,
            MARKS: self._marks,
            LAST_EVENT: self._last,
        }
        if self._trouble:
            return ERROR, self._trouble, values
        if not self.keeps:
            return OK, 'keeps nothing for bags of faults and marks', values
        return OK, 'writing' if self.event else 'keeping the last seconds', values

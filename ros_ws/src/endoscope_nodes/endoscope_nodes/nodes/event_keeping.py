"""The recorder's part in keeping events: what led to a fault or an operator's mark, as a bag."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
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

_AT_ONCE = 2
"""Bags that are written at a time, each with the last seconds until it is written; what happens
beside so many is noted in the last of them."""


@dataclass(eq=False)
class _Writing:
    event: EventBag
    begins_ns: int = 0  # at the latest, by the steady clock
    ends_ns: int = 0


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
        self._writing: list[_Writing] = []
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
    def events(self) -> list[EventBag]:
        """Whose bags are being written, oldest first."""
        return [writing.event for writing in self._writing]

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
                lacking = [event for event in self.events if event.lacks_reason]
                if self._cause and lacking:
                    lacking[-1].explain(self._cause)

    def _on_event(self, kind: str, reason: str = '') -> None:
        """Keep what came before in a bag; a mark is noted in a bag that is being written."""
        ticker = self._node.ticker
        now_ns, steady_ns = ticker.now_ns(), ticker.monotonic_ns()
        if not now_ns:
            return
        written = self._writing
        if written and (kind == MARK or len(written) == _AT_ONCE):
            written[-1].event.add(kind, now_ns, reason)
        else:
            self._collect(now_ns)
            written.append(_Writing(EventBag(self.recent, kind, now_ns, reason)))
        written[-1].begins_ns, written[-1].ends_ns = steady_ns + _REASON_NS, steady_ns + _AFTER_NS
        if reason and written[-1].event.session is None:
            self._begin(written[-1])

    def _begin(self, writing: _Writing) -> None:
        event = writing.event
        try:
            path = new_event_bag(self._folder(), event.kind, self._most)
            event.begin(lambda records: self._open_session(path, records))
        except BagError as error:
            self._writing.remove(writing)
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
        """Write what arrived to the bags that are being written, and end each in time."""
        if not self._writing:
            return
        steady_ns = self._node.ticker.monotonic_ns()
        piece = packed(arrivals)
        for writing in list(self._writing):
            event = writing.event
            event.arrive(piece, len(arrivals))
            if event.session is None:
                if not event.lacks_reason or steady_ns >= writing.begins_ns:
                    self._begin(writing)
            elif event.session.full or (steady_ns >= writing.ends_ns and event.caught_up):
                self._end(writing)

    def close(self) -> None:
        """Finish the bags that are being written."""
        if self._writing:
            self._collect(self._node.ticker.now_ns())
        for writing in list(self._writing):
            if writing.event.session is None:
                self._begin(writing)
            if writing in self._writing:
                self._end(writing)

    def _end(self, writing: _Writing) -> None:
        self._writing.remove(writing)
        event = writing.event
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
        return OK, 'writing' if self._writing else 'keeping the last seconds', values

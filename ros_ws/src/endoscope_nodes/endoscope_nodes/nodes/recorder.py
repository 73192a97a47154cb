"""Records topics into a bag: every message as it came, counted, with what was lost."""

import math
import time
from dataclasses import replace
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.serialization import deserialize_message
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import String

from endoscope_bags.errors import BagError
from endoscope_bags.recent_messages import RecentMessages
from endoscope_bags.recorder import Recorder
from endoscope_bags.recording_session import SessionReport
from endoscope_core.atomic_output import with_final_names
from endoscope_nodes import names
from endoscope_nodes.client.graph_listener import SUPERVISOR
from endoscope_nodes.nodes.heard_topics import HeardTopics
from endoscope_nodes.runtime.diagnostics import ERROR, OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import RecorderParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import EVENT, RESULT

_MEGABYTE = 1_000_000
_LOOK_PERIOD_S = 0.1
_UNTYPED_S = 2.0
_WATCHED_S = 60.0
"""What is kept at least where the rig is watched: the bag of an alarm begins before the change."""


class RecorderNode(EndoscopeNode):
    """Records from ``recorder/start`` to ``recorder/stop`` or the end; a named bag from the start.

    In simulated time both stamps of a message are the tick in which it came, so that the same
    simulation gives the same bag. Losses and a full disk are reported in the diagnostics, in the
    bag, and by exit code 1. The last seconds are kept in memory for the bag of a ``FAULT`` or of a
    ``recorder/mark``. Every bag begins with what was in force.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('recorder', context)
        p = self.parameters(RecorderParameters, self._on_parameters)
        if p.keep and context.value_given('watch', 'active'):
            p = replace(p, keep=max(p.keep, _WATCHED_S))
        self._keeps = p.keep > 0.0
        recent = RecentMessages(p.keep, p.keep_room * _MEGABYTE)
        self.bags = Recorder(self.rig, recent, p.bag, p.keep_bags, self._collect, self._notify)
        self._heard = HeardTopics(self, checked_names(p.topics), self.bags, self._collect)
        self._asked_for = p.topics != RecorderParameters().topics
        self._says_untyped_s = math.inf  # when topics that nobody publishes are named
        self._supervisor = f'{self.get_namespace().rstrip("/")}/{SUPERVISOR}'
        self.serve(names.RECORDER_START, self.start_as_asked)
        self.serve(names.RECORDER_STOP, self.stop_as_asked)
        if self.ticker.simulated:
            self.ticker.add(self._on_tick)
        else:
            self.ticker.every(p.drain_period, self._collect)
        # The graph is looked at in real time: publishers come before simulated time begins.
        self.create_timer(
            _LOOK_PERIOD_S, self._look_around, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self.diagnostics.add('recording', self._report)
        self.diagnostics.add('events', self._report_events)
        if self._keeps:
            subscribe = self.create_subscription
            subscribe(String, names.OPERATING_STATE, self._on_state, RESULT)
            subscribe(String, names.RECORDER_MARK, self._on_mark, EVENT)
            subscribe(DiagnosticArray, names.DIAGNOSTICS, self._on_diagnostics, EVENT, raw=True)
        if p.autostart and p.bag:
            try:
                self.start()
            except BagError as error:
                raise ParameterError(f"recorder: parameter 'bag': {error}") from error

    @property
    def announcement(self) -> str:
        """Say how to begin a recording, where none is being made."""
        recording = self.bags.session is not None
        return '' if recording else f'not recording: {self.operate("record start")}'

    @property
    def last_report(self) -> SessionReport | None:
        """How the last recording went; None before the first has ended."""
        return self.bags.last_report

    def _on_parameters(self, new: RecorderParameters) -> None:
        self.bags.path = new.bag

    def start(self) -> Path:
        """Begin a recording and return where it goes; BagError if one is under way already."""
        path = self.bags.start(self.ticker.now_ns(), self.operate('record stop'))
        self._says_untyped_s = time.monotonic() + _UNTYPED_S
        self.get_logger().info(f'recording to {with_final_names(str(path))}')
        return path

    def stop(self) -> SessionReport:
        """End the recording and say how it went; BagError if there is none."""
        report = self.bags.stop()
        silent = [topic for topic, count in report.counts.items() if not count]
        silent += self._heard.untyped
        if silent and (self._asked_for or not report.message_count):
            self.get_logger().warning(f'no message came on {", ".join(silent)}')
        if report.complete:
            self.get_logger().info(str(report))
        else:
            self.exit_code = 1
            self.get_logger().error(str(report))
        return report

    def extra_readers(self) -> list[tuple[str, int]]:
        """Topics that are read past the executor, and how many publishers each has found."""
        return self._heard.publishers()

    def close(self) -> None:
        """Finish what is being written."""
        if self.bags.session is not None:
            self.stop()
        self.bags.events.close()
        self._heard.close()

    def start_as_asked(self) -> tuple[bool, str]:
        """Begin a recording that is the asker's; whether it has begun, and where or why not."""
        try:
            return True, with_final_names(str(self.start()))
        except BagError as error:
            return False, str(error)

    def stop_as_asked(self) -> tuple[bool, str]:
        """End the recording; whether it is whole, and how it went."""
        try:
            report = self.stop()
        except BagError as error:
            return False, str(error)
        return report.complete, str(report)

    def _notify(self, words: str, failed: bool) -> None:
        # A place in the code that logs has one severity for ever.
        if not failed:
            self.get_logger().info(words)
            return
        self.exit_code = 1
        self.get_logger().error(words)
        self.diagnostics.publish()

    def _on_state(self, message: String) -> None:
        now, steady = self.ticker.now_ns(), self.ticker.monotonic_ns()
        self.bags.events.take_state(message.data, now, steady)

    def _on_mark(self, message: String) -> None:
        self.bags.events.mark(message.data, self.ticker.now_ns(), self.ticker.monotonic_ns())
        # Whoever asked waits for the answer.
        self.diagnostics.publish()

    def _on_diagnostics(self, data: bytes) -> None:
        # One node of a dozen is listened to: reading what the others say takes a hundred times
        # longer.
        if self._supervisor.encode() not in data:
            return
        for status in deserialize_message(data, DiagnosticArray).status:
            if status.name == self._supervisor:
                causes = [value.value for value in status.values if value.key == 'cause']
                self.bags.events.explain(causes[-1] if causes else '')

    def _look_around(self) -> None:
        if not self._heard.look_around():
            return
        recording = self.bags.session is not None
        if recording and self._heard.untyped and time.monotonic() > self._says_untyped_s:
            self._says_untyped_s = math.inf
            for words in self._heard.unpublished():
                self.get_logger().warning(words)
        losses = self.bags.new_losses()
        if losses:
            self.get_logger().error(losses)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        self._collect()
        self._heard.tick(stamp_ns)

    def _collect(self) -> None:
        now, ticker = self.ticker.now_ns(), self.ticker
        if now:
            arrivals, steady = self._heard.take(now), ticker.monotonic_ns()
            stale = not ticker.simulated
            self.bags.take(arrivals, self._heard.holding, now, steady, stale)

    def _report(self) -> Report:
        if self.bags.session is None:
            return OK, 'not recording', {}
        report = self.bags.session.report()
        values: dict[str, object] = {
            names.BAG: with_final_names(str(report.path)),
            'messages': report.message_count,
            'lost': report.lost_count,
        }
        for topic, count in report.counts.items():
            values[topic] = f'{count} recorded, {report.lost[topic]} lost'
        if report.full:
            return ERROR, report.full, values
        if report.lost_count:
            return ERROR, f'{report.lost_count} messages lost', values
        return OK, 'recording', values

    def _report_events(self) -> Report:
        events, recent = self.bags.events, self.bags.recent
        values: dict[str, object] = {
            'kept [s]': recent.seconds,
            'kept [MB]': recent.size / _MEGABYTE,
            names.MARKS: events.marks,
            names.LAST_EVENT: events.last,
        }
        if events.error:
            return ERROR, events.error, values
        if not self._keeps:
            return OK, 'keeps nothing for bags of faults and marks', values
        return OK, 'writing' if events.events else 'keeping the last seconds', values


def checked_names(topics: tuple[str, ...]) -> tuple[str, ...]:
    """Return names of topics, if all of them can be some."""
    for topic in topics:
        try:
            validate_topic_name(topic)
        except InvalidTopicNameException as error:
            raise ParameterError(
                f"recorder: parameter 'topics': {topic!r} is not a topic name"
            ) from error
    return topics

"""Records topics into a bag: every message as it came, counted, with what was lost."""

import itertools
import math
import struct
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.qos import DurabilityPolicy
from rclpy.validate_topic_name import validate_topic_name
from std_msgs.msg import String

from endoscope_bags.errors import BagError, UnknownTypeError
from endoscope_bags.event_bag import held_since
from endoscope_bags.message_types import begins_with_header, message_type
from endoscope_bags.recording_session import (
    Arrival,
    RecordingSession,
    SessionReport,
    simulated_receipt_ns,
)
from endoscope_bags.topic import QosProfile
from endoscope_core.atomic_output import with_final_names
from endoscope_core.errors import nearest
from endoscope_nodes.names import (
    BAG,
    MOTION_SESSION,
    OPERATING_STATE,
    RECORDER_START,
    RECORDER_STOP,
)
from endoscope_nodes.nodes.event_keeping import EventKeeping
from endoscope_nodes.runtime.diagnostics import ERROR, OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import RecorderParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import RESULT
from endoscope_nodes.runtime.recorded_topics import (
    message_class,
    offered_profiles,
    suitable_qos,
)
from endoscope_nodes.runtime.streams import RawSubscription
from endoscope_nodes.topics import BY_NAME

_STAMP = struct.Struct('<iI')
_SECOND = 1_000_000_000
_LOOK_PERIOD_S = 0.1
_UNTYPED_S = 2.0
_WATCHED_S = 60.0
"""What is kept at least where the rig is watched: the bag of an alarm begins before the change."""


@dataclass
class _Source:
    name: str
    type_name: str
    kind: type
    latched: bool
    has_stamp: bool
    subscription: RawSubscription
    number: int
    publishers_seen: int = -1
    offered: tuple[QosProfile, ...] = ()

    def count_publishers(self) -> int:
        # The subscription may be replaced by another one.
        return self.subscription.count_publishers()


class RecorderNode(EndoscopeNode):
    """Records from ``recorder/start`` to ``recorder/stop`` or the end; a named bag from the start.

    In real time a message is recorded with the middleware's stamps of receipt and publication. In
    simulated time both are the tick of ``/clock`` in which it came, so that the same simulation
    gives the same bag. Losses, found as gaps in the publishers' numbers, and a full disk are told
    in the diagnostics, in the bag, and by exit code 1.

    What came in the last seconds is kept in memory whether or not it is recorded. When the slave
    goes to ``FAULT``, or ``recorder/mark`` says something, it and what follows becomes a bag of its
    own. Every bag begins with what was in force: latched topics and the motion session.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('recorder', context)
        self._bag = ''
        p = self.parameters(RecorderParameters, self._on_parameters)
        self._bag = p.bag
        if p.keep and context.told('watch', 'active'):
            p = replace(p, keep=max(p.keep, _WATCHED_S))
        self._topics = checked_names(p.topics)
        self._events = EventKeeping(
            self,
            p,
            collect=self._collect,
            folder=lambda: Path(self._bag or new_bag()).parent,
            open_session=self._new_session,
        )
        self._holding: set[int] = set()
        self._asked_for = p.topics != RecorderParameters().topics
        self._said_untyped_s = 0.0
        self._session: RecordingSession | None = None
        self._sources: list[_Source] = []
        self._to_look_at: list[_Source] = []
        self._untyped = list(self._topics)
        self._last_tick_ns = 0
        self._said_loss = 0
        self.last_report: SessionReport | None = None  # none before the first has ended
        self.serve(RECORDER_START, self.start_as_asked)
        self.serve(RECORDER_STOP, self.stop_as_asked)
        if self.ticker.simulated:
            self.ticker.add(self._on_tick)
        else:
            self.ticker.every(p.drain_period, self._drain)
        # The graph is looked at in real time: publishers come before simulated time begins.
        self.create_timer(
            _LOOK_PERIOD_S, self._look_around, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )
        self.diagnostics.add('recording', self._report)
        self.diagnostics.add('events', self._events.report)
        if self._events.keeps:
            self.create_subscription(String, OPERATING_STATE, self._on_state, RESULT)
        self._subscribe_untyped()
        if p.autostart and p.bag:
            try:
                self.start()
            except BagError as error:
                raise ParameterError(f"recorder: parameter 'bag': {error}") from error

    @property
    def announcement(self) -> str:
        """Say how to begin a recording, where none is being made."""
        return '' if self._session else f'not recording: {self.operate("record start")}'

    def _on_parameters(self, new: RecorderParameters) -> None:
        self._bag = new.bag

    def start(self) -> Path:
        """Begin a recording and return where it goes; BagError if one is under way already."""
        if self._session is not None:
            there = with_final_names(str(self._session.path))
            ends = self.operate('record stop')
            raise BagError(f'already recording to {there}: `{ends}` ends that')
        path = Path(self._bag or new_bag())
        now_ns = self.ticker.now_ns()
        # What came before is no part of it, but what is in force.
        self._collect(now_ns)
        self._session = self._new_session(path)
        self._session.accept(held_since(self._events.recent.in_force, now_ns))
        self._said_loss = 0
        self._said_untyped_s = time.monotonic() + _UNTYPED_S
        self.get_logger().info(f'recording to {with_final_names(str(path))}')
        return path

    def stop(self) -> SessionReport:
        """End the recording and say how it went; BagError if there is none."""
        if self._session is None:
            raise BagError('not recording')
        self._collect(self.ticker.now_ns())
        session, self._session = self._session, None
        report = self.last_report = session.close('on request')
        silent = [topic for topic, count in report.counts.items() if not count] + self._untyped
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
        return [(source.name, source.count_publishers()) for source in self._sources]

    def close(self) -> None:
        """Finish what is being written."""
        if self._session is not None:
            self.stop()
        self._events.close()
        for source in self._sources:
            source.subscription.close()
        self._sources = []

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

    def _on_state(self, message: String) -> None:
        self._events.on_state(message.data)

    def _subscribe_untyped(self) -> None:
        """Subscribe to the topics whose type is known by now."""
        untyped, self._untyped = self._untyped, []
        for topic in untyped:
            try:
                self._subscribe(topic)
            except UnknownTypeError as error:
                self.get_logger().error(f'{topic} is not recorded: {error}')

    def _subscribe(self, topic: str) -> None:
        namespace = self.get_namespace().rstrip('/') + '/'
        known = BY_NAME.get(topic) or BY_NAME.get(topic.removeprefix(namespace))
        if known is not None:
            self._add_source(topic, known.type, known.asked.latched)
            return
        types = dict(self.get_topic_names_and_types()).get(self.resolve_topic_name(topic), [])
        if types:
            self._add_source(topic, types[0], latched=False)
        else:
            self._untyped.append(topic)

    def _add_source(self, topic: str, type_name: str, latched: bool) -> None:
        full = self.resolve_topic_name(topic)
        kind = message_class(type_name)
        has_stamp = begins_with_header(message_type(type_name).definition)
        publishers = self.get_publishers_info_by_topic(full)
        qos = suitable_qos(latched, publishers)
        subscription = RawSubscription(self, kind, topic, qos)
        number = len(self._sources)
        source = _Source(full, type_name, kind, latched, has_stamp, subscription, number)
        source.offered = offered_profiles(publishers)
        self._sources.append(source)
        self._note_whether_it_holds(source)
        for session in (self._session, *(event.session for event in self._events.events)):
            if session is not None:
                self._announce(source, session)

    def _announce(self, source: _Source, session: RecordingSession) -> None:
        number = session.add_topic(
            source.name, source.type_name, lambda: self._offered(source), source.count_publishers
        )
        assert number == source.number

    def _offered(self, source: _Source) -> tuple[QosProfile, ...]:
        # To ask for it costs a tick: what was heard of these publishers before is as good.
        if not source.offered or source.count_publishers() != source.publishers_seen:
            source.offered = offered_profiles(self.get_publishers_info_by_topic(source.name))
        return source.offered

    def _new_session(
        self, path: Path, records: Mapping[str, dict[str, str]] | None = None
    ) -> RecordingSession:
        session = RecordingSession(path, rig=self.rig, records=records)
        for source in self._sources:
            self._announce(source, session)
        return session

    def _note_whether_it_holds(self, source: _Source) -> None:
        """Note topics whose last message holds until the next one: bags begin with these."""
        latched = source.subscription.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        if latched or source.name == self.resolve_topic_name(MOTION_SESSION):
            self._holding.add(source.number)
        else:
            self._holding.discard(source.number)

    def _look_around(self) -> None:
        """Adapt one topic to its publishers; after the last one see what else there is."""
        # One at a time, because the graph's answer for all of them would cost a tick.
        if self._to_look_at:
            self._adapt(self._to_look_at.pop())
            return
        self._subscribe_untyped()
        session = self._session
        if session is not None and self._untyped and time.monotonic() > self._said_untyped_s:
            self._said_untyped_s = math.inf
            there = [name for name, _ in self.get_topic_names_and_types()]
            for topic in self._untyped:
                full = self.resolve_topic_name(topic)
                self.get_logger().warning(f'nobody publishes {full}: {nearest(full, there)}')
        self._to_look_at = list(self._sources)
        report = session.report() if session is not None else None
        if report is not None and report.lost_count > self._said_loss:
            self._said_loss = report.lost_count
            self.get_logger().error(str(report))

    def _adapt(self, source: _Source) -> None:
        # Who publishes with what profile costs a tick to ask for; how many do costs little.
        count = self.count_publishers(source.name)
        if count == source.publishers_seen == source.count_publishers():
            return
        source.publishers_seen = count
        publishers = self.get_publishers_info_by_topic(source.name)
        source.offered = offered_profiles(publishers)
        qos = suitable_qos(source.latched, publishers)
        if publishers and (qos.durability, qos.reliability) != (
            source.subscription.qos.durability,
            source.subscription.qos.reliability,
        ):
            self._collect(self.ticker.now_ns())
            source.subscription.close()
            source.subscription = RawSubscription(self, source.kind, source.name, qos)
            self._note_whether_it_holds(source)

    def _on_tick(self, stamp_ns: int, periods: int) -> None:
        self._collect(stamp_ns)
        self._last_tick_ns = stamp_ns

    def _drain(self) -> None:
        self._collect(self.ticker.now_ns())

    def _collect(self, now_ns: int) -> None:
        if now_ns == 0:
            return
        session, arrivals = self._session, []
        simulated = self.ticker.simulated
        for source in self._sources:
            number = source.number
            for data, info in source.subscription.take():
                if simulated:
                    received = simulated_receipt_ns(
                        _stamp_ns(data) if source.has_stamp else None, self._last_tick_ns, now_ns
                    )
                    published = received
                else:
                    received = info['received_timestamp']
                    published = info['source_timestamp']
                arrivals.append(
                    Arrival(received, number, info['publication_sequence_number'], published, data)
                )
        self._events.recent.add(arrivals, self._holding, now_ns)
        if session is not None:
            if arrivals:
                session.accept(arrivals)
            if not simulated:
                session.flush_stale(now_ns)
        self._events.go_on(arrivals)

    def _report(self) -> Report:
        if self._session is None:
            return OK, 'not recording', {}
        report = self._session.report()
        values: dict[str, object] = {
            BAG: with_final_names(str(report.path)),
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


def new_bag() -> str:
    """Return where a recording goes that has no name; several of one second are numbered."""
    first = time.strftime('bags/recording-%Y%m%d-%H%M%S')
    numbered = (f'{first}-{n}' for n in itertools.count(2))
    return next(name for name in itertools.chain([first], numbered) if not Path(name).exists())


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


def _stamp_ns(data: bytes) -> int:
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return int(seconds) * _SECOND + int(nanoseconds)

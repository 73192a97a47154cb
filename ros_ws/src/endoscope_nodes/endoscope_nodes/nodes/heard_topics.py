"""The recorder's ears: subscriptions that follow the publishers of what is recorded."""

import struct
from collections.abc import Callable
from dataclasses import dataclass

from rclpy.qos import DurabilityPolicy

from endoscope_bags.errors import UnknownTypeError
from endoscope_bags.message_types import begins_with_header, message_type
from endoscope_bags.recorder import Recorder
from endoscope_bags.recording_session import Arrival, simulated_receipt_ns
from endoscope_bags.topic import QosProfile
from endoscope_core.errors import nearest
from endoscope_nodes.names import MOTION_SESSION
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.recorded_topics import message_class, offered_profiles, suitable_qos
from endoscope_nodes.runtime.streams import RawSubscription
from endoscope_nodes.topics import BY_NAME

_STAMP = struct.Struct('<iI')
_SECOND = 1_000_000_000


@dataclass
class _Source:
    name: str
    kind: type
    latched: bool
    has_stamp: bool
    subscription: RawSubscription
    number: int = 0
    publishers_seen: int = -1
    offered: tuple[QosProfile, ...] = ()

    def count_publishers(self) -> int:
        # The subscription may be replaced by another one.
        return self.subscription.count_publishers()


class HeardTopics:
    """Hears `topics` for a recorder; `collect` takes what waits before a reader is replaced."""

    def __init__(
        self,
        node: EndoscopeNode,
        topics: tuple[str, ...],
        recorder: Recorder,
        collect: Callable[[], None],
    ) -> None:
        self._node, self._recorder, self._collect = node, recorder, collect
        self._sources: list[_Source] = []
        self._to_look_at: list[_Source] = []
        self._last_ns = 0
        self.untyped = list(topics)  # whose type is not known yet
        # Numbers of topics whose last message holds until the next one: bags begin with these.
        self.holding: set[int] = set()
        self._subscribe_untyped()

    def publishers(self) -> list[tuple[str, int]]:
        """Topics that are heard, and how many publishers each has found."""
        return [(source.name, source.count_publishers()) for source in self._sources]

    def close(self) -> None:
        """Hear no more."""
        for source in self._sources:
            source.subscription.close()
        self._sources = []

    def take(self, now_ns: int) -> list[Arrival]:
        """Return what has arrived by a time in ns."""
        simulated, arrivals = self._node.ticker.simulated, []
        for source in self._sources:
            for data, info in source.subscription.take():
                received, published = info['received_timestamp'], info['source_timestamp']
                if simulated:
                    stamp = _stamp_ns(data) if source.has_stamp else None
                    received = published = simulated_receipt_ns(stamp, self._last_ns, now_ns)
                arrivals.append(
                    Arrival(
                        received,
                        source.number,
                        info['publication_sequence_number'],
                        published,
                        data,
                    )
                )
        return arrivals

    def tick(self, stamp_ns: int) -> None:
        """Note that all that came up to a tick of simulated time has been taken."""
        self._last_ns = stamp_ns

    def look_around(self) -> bool:
        """Adapt one topic to its publishers; after the last see what else there is: True."""
        # One at a time, because the graph's answer for all of them would cost a tick.
        if self._to_look_at:
            self._adapt(self._to_look_at.pop())
            return False
        self._subscribe_untyped()
        self._to_look_at = list(self._sources)
        return True

    def unpublished(self) -> list[str]:
        """A sentence for each topic that nobody publishes, with the nearest that somebody does."""
        there = [name for name, _ in self._node.get_topic_names_and_types()]
        known = map(self._node.resolve_topic_name, self.untyped)
        return [f'nobody publishes {full}: {nearest(full, there)}' for full in known]

    def _subscribe_untyped(self) -> None:
        """Subscribe to the topics whose type is known by now."""
        untyped, self.untyped = self.untyped, []
        for topic in untyped:
            try:
                self._subscribe(topic)
            except UnknownTypeError as error:
                self._node.get_logger().error(f'{topic} is not recorded: {error}')

    def _subscribe(self, topic: str) -> None:
        node = self._node
        namespace = node.get_namespace().rstrip('/') + '/'
        known = BY_NAME.get(topic) or BY_NAME.get(topic.removeprefix(namespace))
        if known is not None:
            self._add(topic, known.type, known.asked.latched)
            return
        types = dict(node.get_topic_names_and_types()).get(node.resolve_topic_name(topic), [])
        if types:
            self._add(topic, types[0], latched=False)
        else:
            self.untyped.append(topic)

    def _add(self, topic: str, type_name: str, latched: bool) -> None:
        full, kind = self._node.resolve_topic_name(topic), message_class(type_name)
        has_stamp = begins_with_header(message_type(type_name).definition)
        publishers = self._node.get_publishers_info_by_topic(full)
        subscription = RawSubscription(self._node, kind, topic, suitable_qos(latched, publishers))
        source = _Source(full, kind, latched, has_stamp, subscription)
        source.offered = offered_profiles(publishers)
        source.number = self._recorder.add_topic(
            full, type_name, lambda: self._offered(source), source.count_publishers
        )
        self._sources.append(source)
        self._note_whether_it_holds(source)

    def _offered(self, source: _Source) -> tuple[QosProfile, ...]:
        # To ask for it costs a tick: what was heard of these publishers before is as good.
        if not source.offered or source.count_publishers() != source.publishers_seen:
            publishers = self._node.get_publishers_info_by_topic(source.name)
            source.offered = offered_profiles(publishers)
        return source.offered

    def _note_whether_it_holds(self, source: _Source) -> None:
        latched = source.subscription.qos.durability == DurabilityPolicy.TRANSIENT_LOCAL
        if latched or source.name == self._node.resolve_topic_name(MOTION_SESSION):
            self.holding.add(source.number)
        else:
            self.holding.discard(source.number)

    def _adapt(self, source: _Source) -> None:
        # Who publishes with what profile costs a tick to ask for; how many do costs little.
        count = self._node.count_publishers(source.name)
        if count == source.publishers_seen == source.count_publishers():
            return
        source.publishers_seen = count
        publishers = self._node.get_publishers_info_by_topic(source.name)
        source.offered = offered_profiles(publishers)
        qos, asked = suitable_qos(source.latched, publishers), source.subscription.qos
        if publishers and (qos.durability, qos.reliability) != (
            asked.durability,
            asked.reliability,
        ):
            self._collect()
            source.subscription.close()
            source.subscription = RawSubscription(self._node, source.kind, source.name, qos)
            self._note_whether_it_holds(source)


def _stamp_ns(data: bytes) -> int:
    seconds, nanoseconds = _STAMP.unpack_from(data, 4)
    return int(seconds) * _SECOND + int(nanoseconds)

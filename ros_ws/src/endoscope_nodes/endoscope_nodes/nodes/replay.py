"""Publishes the topics of a bag again, at their pace or another, with ``/clock``."""

import time
from collections.abc import Iterator

from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock as ClockMessage

from endoscope_bags import RawMessage, Recording, Topic, open_bag
from endoscope_bags.cdr import encode_clock
from endoscope_bags.errors import BagError
from endoscope_nodes.names import CLOCK, DIAGNOSTICS, MOTOR_COMMAND, MOTOR_MEASURED
from endoscope_nodes.runtime.diagnostics import OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import ReplayParameters
from endoscope_nodes.runtime.parameters import ParameterError
from endoscope_nodes.runtime.qos import LOCK_STEP, SENSOR_OFFERED
from endoscope_nodes.runtime.recorded_topics import message_class
from endoscope_nodes.runtime.ticker import TICK_NS

# A reader that asks for what is not offered never connects.
_LONGEST_WAIT_NS = 5_000_000_000
_LINGER_S = 0.5


class ReplayNode(EndoscopeNode):
    """Publishes the recorded bytes in the order of their receipt, then ends the process.

    ``/clock`` goes in steps of 1 ms; each is followed by the messages received until the next. It
    refuses to talk into a running system: where another node publishes one of the topics, or
    measures a motor that recorded commands would move, it says so and ends.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__('replay', context)
        p = self.parameters(ReplayParameters)
        if self.ticker.simulated:
            raise ParameterError("replay: parameter 'use_sim_time' is true; it makes /clock itself")
        self._parameters_ = p
        self._process = context
        try:
            recording = open_bag(p.bag)
        except BagError as error:
            raise ParameterError(f"replay: parameter 'bag': {error}") from error
        self._outputs = {topic.name: self._publisher(topic) for topic in self._chosen(recording)}
        self._messages: Iterator[RawMessage] = recording.messages(list(self._outputs))
        self._next = next(self._messages, None)
        if self._next is None:
            raise ParameterError(f'replay: {p.bag}: nothing to publish in the chosen topics')
        self._total = sum(recording.topics[name].message_count for name in self._outputs)
        self._start_ns = self._next.log_ns // TICK_NS * TICK_NS
        self._clock_ns = self._start_ns - TICK_NS
        self._clock_out = self.create_publisher(ClockMessage, CLOCK, LOCK_STEP) if p.clock else None
        self._begin_ns = time.monotonic_ns() + round(p.delay * 1e9)
        self._wait_until_ns = self._begin_ns + _LONGEST_WAIT_NS
        self._checked = p.beside_live_nodes
        self.published = 0  # messages sent so far
        self.diagnostics.add('replay', self._report)
        self.ticker.every(TICK_NS * 1e-9, self._go_on)

    @property
    def announcement(self) -> str:
        """Name the bag."""
        return f'{self._parameters_.bag}, {self._parameters_.speed:g} times its pace'

    def _chosen(self, recording: Recording) -> list[Topic]:
        wanted = [topic for topic in self._parameters_.topics if topic]
        unknown = [topic for topic in wanted if topic not in recording.topics]
        if unknown:
            raise ParameterError(
                f"replay: parameter 'topics': {recording.path} has no {', '.join(unknown)}; it "
                f'has {", ".join(sorted(recording.topics))}'
            )
        chosen = [recording.topics[name] for name in wanted or sorted(recording.topics)]
        silent = {CLOCK} if self._parameters_.clock else set()
        return [topic for topic in chosen if topic.message_count and topic.name not in silent]

    def _publisher(self, topic: Topic) -> Publisher:
        try:
            kind = message_class(topic.type)
        except BagError as error:
            raise ParameterError(f'replay: topic {topic.name}: {error}') from error
        return self.create_publisher(kind, topic.name, _offered(topic))

    def _go_on(self) -> None:
        now = time.monotonic_ns()
        if not self.published and now < self._wait_until_ns and not self._connected():
            self._begin_ns = now + round(self._parameters_.delay * 1e9)
        if now < self._begin_ns or self._next is None:
            return
        if not self._checked:
            live = self._live_nodes()
            if live:
                self._end(
                    f'refused: {live}; replay in a ROS_DOMAIN_ID of its own, or set '
                    'beside_live_nodes',
                    failed=True,
                )
                return
            self._checked = True
        until = self._start_ns + round((now - self._begin_ns) * self._parameters_.speed)
        more = True
        while more and self._clock_ns + TICK_NS <= until:
            self._clock_ns += TICK_NS
            if self._clock_out is not None:
                self._clock_out.publish(encode_clock(self._clock_ns))
            more = self._publish_until(self._clock_ns + TICK_NS)
        if not more:
            self._end(f'{self._played} replayed', failed=False)

    def _publish_until(self, end_ns: int) -> bool:
        """Publish what was received before `end_ns`; return whether there is more."""
        message = self._next
        while message is not None and message.log_ns < end_ns:
            self._outputs[message.topic].publish(message.data)
            self.published += 1
            message = next(self._messages, None)
        self._next = message
        return message is not None

    def _connected(self) -> bool:
        """Whether all readers that are known to be there are connected."""
        return all(
            publisher.get_subscription_count() >= self.count_subscribers(topic)
            for topic, publisher in self._outputs.items()
        )

    def _live_nodes(self) -> str:
        """Name a node that the replay would talk over; empty if there is none."""
        watched = {*self._outputs, *([CLOCK] if self._clock_out is not None else [])}
        for topic in self._outputs:
            if topic.endswith('/' + MOTOR_COMMAND):
                watched.add(topic.removesuffix(MOTOR_COMMAND) + MOTOR_MEASURED)
        watched.discard(DIAGNOSTICS)
        for topic in sorted(watched):
            for info in self.get_publishers_info_by_topic(topic):
                if info.node_name != self.get_name():
                    return f'{topic} is published by the node {info.node_name}'
        return ''

    def _end(self, text: str, failed: bool) -> None:
        self._next = None
        if failed:
            self.exit_code = 1
            self.get_logger().error(text)
        else:
            self.get_logger().info(text)
        # Readers forget what a process sent that is gone before they looked.
        self.ticker.every(_LINGER_S, self._process.stop)

    def close(self) -> None:
        """Say how far it came, if it was stopped on the way."""
        if self._next is not None:
            self.get_logger().info(f'stopped: {self._played} of {self._total} replayed')

    @property
    def _played(self) -> str:
        return f'{self._parameters_.bag}: {self.published} messages, {self._seconds:.1f} s'

    @property
    def _seconds(self) -> float:
        return max(0, self._clock_ns - self._start_ns) * 1e-9

    def _report(self) -> Report:
        return OK, 'replaying', {'messages': self.published, 'seconds': self._seconds}


def _offered(topic: Topic) -> QoSProfile:
    """As it was offered when recorded; a deep queue where the recording does not state it."""
    latched = bool(topic.qos) and all(q.durability == 'transient_local' for q in topic.qos)
    best_effort = bool(topic.qos) and all(q.reliability == 'best_effort' for q in topic.qos)
    return QoSProfile(
        depth=max([SENSOR_OFFERED.depth, *(q.depth for q in topic.qos)]),
        history=HistoryPolicy.KEEP_LAST,
        reliability=ReliabilityPolicy.BEST_EFFORT if best_effort else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )

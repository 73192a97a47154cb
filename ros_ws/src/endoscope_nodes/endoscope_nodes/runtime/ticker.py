"""The 1 kHz beat that all nodes of a process share, in real or in simulated time.

In simulated time no tick begins before what the nodes sent each other in the last one was heard.
"""

import struct
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock as ClockMessage

from endoscope_nodes.names import CLOCK
from endoscope_nodes.runtime.qos import SENSOR_ASKED

TICK_NS = 1_000_000
TICK_S = TICK_NS * 1e-9
TickCallback = Callable[[int, int], None]
_STAMP = struct.Struct('<iI')
_SLOW_NS = 20_000_000
_USUAL_DELAY_NS = 5_000_000
# What a hand says meanwhile waits to be heard, and is no silence of it.
_LONGEST_WAIT_NS = 50_000_000


class InFlight:
    """Counts messages on their way, so that no tick begins before all of the last one was heard.

    The middleware hands a message to its readers one after the other. On a busy machine one of them
    may be told of it later than the next tick, which would then depend on the machine.
    """

    def __init__(self) -> None:
        self.count = 0  # once for each reader
        # Called when the last one has been dealt with.
        self.landed: Callable[[], object] = lambda: None
        # Of each topic how many are on their way, in a list of one that its counters share.
        self._sent: defaultdict[str, list[int]] = defaultdict(lambda: [0])
        self._readers: defaultdict[str, list[Node]] = defaultdict(list)
        self._senders: set[str] = set()
        self._noted: dict[str, Callable[[Any], object]] = {}

    def sent_by_us(self, topic: str) -> bool:
        """Whether a node of this process sends on a topic, given by its full name."""
        return topic in self._senders

    def note(self, topic: str, callback: Callable[[Any], object]) -> None:
        """Call back with what a node of this process sends on a topic, without a subscription."""
        self._noted[topic] = callback

    def sent[M](self, topic: str, publish: Callable[[M], None]) -> Callable[[M], None]:
        """Count what is published by a function on a topic."""
        self._senders.add(topic)
        sent, readers, noted = self._sent[topic], self._readers[topic], self._noted

        def counted(message: M) -> None:
            sent[0] += len(readers)
            self.count += len(readers)
            if topic in noted:
                noted[topic](message)
            publish(message)

        return counted

    def taken[M](
        self, node: Node, topic: str, callback: Callable[[M], object]
    ) -> Callable[[M], None]:
        """Count what a node's callback has dealt with."""
        self._readers[topic].append(node)
        sent = self._sent[topic]

        def counted(message: M) -> None:
            try:
                callback(message)
            finally:
                # What comes from another process was not counted.
                if sent[0]:
                    sent[0] -= 1
                    self.count -= 1
                    if not self.count:
                        self.landed()

        return counted

    def forget(self, owners: Sequence[object]) -> None:
        """Expect nothing more of these nodes."""
        for nodes in self._readers.values():
            nodes[:] = [node for node in nodes if node not in owners]

    def give_up(self) -> None:
        """Take what has not come for lost."""
        self.count = 0
        for sent in self._sent.values():
            sent[0] = 0


class Ticker:
    """Calls its listeners at each beat and says how many milliseconds went by.

    In real time a timer of the steady clock beats; in simulated time each message on ``/clock`` is
    a beat, so that one clock can run the whole graph in lock-step. One ticker serves all nodes of a
    process, because a timer or a subscription of each node's own would cost more than most nodes
    do. `stride`, from beat to beat, is in ms; simulated time beats as its clock does.
    """

    def __init__(self, node: Node, simulated: bool, stride: int = 1, clock: str = CLOCK) -> None:
        self._node = node
        self.simulated = simulated
        self._stride = stride
        self.ticks = 0  # beats delivered
        self.missed = 0  # due, but too late to be told from the next
        # Time that this process was not run though a beat was due; delays of up to 5 ms, which
        # every desktop kernel makes, do not count.
        self.late_ns = 0
        # What the nodes of this process have sent each other in simulated time.
        self.in_flight = InFlight()
        # Simulated time goes no faster than a person's: set by who gives it in this process.
        self.paced = False
        self._hand_ns = self._hand_at_ns = 0
        self._slow_ns = 0
        self._listeners: tuple[TickCallback, ...] = ()
        self._periodic: list[_Periodic] = []
        self._sim_ns = 0
        self._last_ns = 0
        self._timer_started = False
        self._slow_started = False
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        # Stamps follow the steady clock from one reading of the system clock: a step of the
        # system clock must not look like a step of the motion.
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        if simulated:
            topic = node.resolve_topic_name(clock)
            take = self.in_flight.taken(node, topic, self._on_clock)
            node.create_subscription(ClockMessage, clock, take, SENSOR_ASKED, raw=True)

    @property
    def rate(self) -> int:
        """Beats a second in real time, and of a clock that this process gives."""
        return 1000 // self._stride

    def now_ns(self) -> int:
        """Time for stamps in nanoseconds; 0 while simulated time has not begun."""
        return self._sim_ns if self.simulated else time.monotonic_ns() + self._offset_ns

    def monotonic_ns(self) -> int:
        """Time for ages and watchdogs: the steady clock, or simulated time."""
        return self._sim_ns if self.simulated else time.monotonic_ns()

    def hand_ns(self) -> int:
        """Time by which a person's hand is judged: the steady clock, also where time is paced."""
        return self._hand_ns if self.paced else self.monotonic_ns()

    def turn_hand(self) -> None:
        """Let the time of hands go on, where time is paced; at each beat, before it is given."""
        now = time.monotonic_ns()
        self._hand_ns += min(now - self._hand_at_ns, _LONGEST_WAIT_NS)
        self._hand_at_ns = now

    def monotonic_of(self, stamp_ns: int) -> int:
        """Time for ages at which a beat was due: beats come late, what they sample must not."""
        return stamp_ns if self.simulated else stamp_ns - self._offset_ns

    def add(self, listener: TickCallback) -> None:
        """Call `listener(stamp_ns, periods)` at each beat, `periods` ms after the one before."""
        self._listeners += (listener,)
        if not self.simulated and not self._timer_started:
            self._timer_started = True
            self._last_ns = time.monotonic_ns()
            self._node.create_timer(
                self._stride * TICK_NS * 1e-9, self._on_timer, clock=self._steady
            )

    def forget(self, owners: Sequence[object]) -> None:
        """Stop calling the methods of these objects, and of what belongs to them as `_node`."""

        def kept(callback: object) -> bool:
            whose = getattr(callback, '__self__', None)
            return not any(
                whose is owner or getattr(whose, '_node', None) is owner for owner in owners
            )

        self._listeners = tuple(x for x in self._listeners if kept(x))
        for item in self._periodic:
            if not kept(item.callback) and item.timer is not None:
                self._node.destroy_timer(item.timer)
        self._periodic = [item for item in self._periodic if kept(item.callback)]
        self.in_flight.forget(owners)

    def every(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call `callback()` at a slower pace, without asking for the 1 kHz beat."""
        period_ns = round(seconds * 1e9)
        # Callbacks of the same pace come one after the other rather than all in the same tick.
        item = _Periodic(period_ns, len(self._periodic) * _SLOW_NS % period_ns, callback)
        if not self.simulated and period_ns < 2 * _SLOW_NS:
            item.timer = self._node.create_timer(seconds, callback, clock=self._steady)
        elif not self.simulated and not self._slow_started:
            self._slow_started = True
            self._node.create_timer(_SLOW_NS * 1e-9, self._on_slow_timer, clock=self._steady)
        self._periodic.append(item)

    def _on_timer(self) -> None:
        beats = (time.monotonic_ns() - self._last_ns) // (self._stride * TICK_NS)
        # What expired in a stall is one beat, and whatever else is handed out of it none.
        if beats <= 0:
            return
        periods = beats * self._stride
        self._note_delay((periods - self._stride) * TICK_NS)
        self._last_ns += periods * TICK_NS
        self._beat(self._last_ns + self._offset_ns, periods)

    def _on_clock(self, data: bytes) -> None:
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        stamp = seconds * 1_000_000_000 + nanoseconds
        if stamp == self._sim_ns or stamp <= 0:
            return
        backwards = stamp < self._sim_ns
        periods = max(1, round((stamp - self._sim_ns) / TICK_NS))
        if backwards or self._sim_ns == 0:
            periods = 1
        if backwards:
            self._node.get_logger().warning('simulated time went back: watches restart')
            for item in self._periodic:
                item.due_ns = None
        self._sim_ns = stamp
        self._beat(stamp, periods)
        self._call_periodic(stamp)

    def _on_slow_timer(self) -> None:
        now = time.monotonic_ns()
        before, self._slow_ns = self._slow_ns, now
        if before and not self._timer_started:
            self._note_delay(now - before - _SLOW_NS)
        self._call_periodic(now)

    def _note_delay(self, delay_ns: int) -> None:
        if delay_ns > _USUAL_DELAY_NS:
            self.late_ns += delay_ns

    def _call_periodic(self, now_ns: int) -> None:
        for item in tuple(self._periodic):
            if item.timer is not None:
                continue
            if item.due_ns is None:
                item.due_ns = now_ns + item.turn_ns
            if now_ns >= item.due_ns:
                item.due_ns = max(item.due_ns + item.period_ns, now_ns)
                item.callback()

    def _beat(self, stamp_ns: int, periods: int) -> None:
        self.ticks += 1
        self.missed += max(0, periods // self._stride - 1)
        for listener in self._listeners:
            listener(stamp_ns, periods)


class _Periodic:
    __slots__ = ('callback', 'due_ns', 'period_ns', 'timer', 'turn_ns')

    def __init__(self, period_ns: int, turn_ns: int, callback: Callable[[], None]) -> None:
        self.period_ns = period_ns
        self.turn_ns = turn_ns
        self.callback = callback
        self.due_ns: int | None = None
        self.timer: Timer | None = None


class SampleClock:
    """Samples at the first tick in each sampling period of a rate in Hz, counted from the epoch."""

    def __init__(self, rate: float) -> None:
        self._period_ns = round(1e9 / rate)
        self._last = -1

    def due(self, stamp_ns: int) -> bool:
        """Whether the tick stamped so is one to sample at; call it for each tick in turn."""
        # By the stamp alone: whoever knows the rate knows which stamps to expect.
        number = stamp_ns // self._period_ns
        if number == self._last:
            return False
        self._last = number
        return True

"""Beats simulated time for the whole graph, a tick at a time, as fast as it can or is to follow."""

import math
import struct
import time
from collections import deque
from collections.abc import Callable
from functools import partial

from rclpy.clock import Clock, ClockType
from rclpy.task import Future
from rosgraph_msgs.msg import Clock as ClockMessage
from sensor_msgs.msg import JointState

from endoscope_bags.cdr import encode_clock
from endoscope_core.errors import EndoscopeError
from endoscope_nodes.names import CLOCK_NODE, FACTOR, SLAVE_MEASURED
from endoscope_nodes.runtime.diagnostics import OK, Report
from endoscope_nodes.runtime.endoscope_node import EndoscopeNode
from endoscope_nodes.runtime.node_context import NodeContext
from endoscope_nodes.runtime.node_parameters import FOLLOWED, SimulationClockParameters
from endoscope_nodes.runtime.qos import LOCK_STEP
from endoscope_nodes.runtime.ticker import SampleClock

_STAMP = struct.Struct('<iI')
# What a late beat may be made up for: more would be seen as a leap.
_DEBT_NS = 20_000_000
_FACTOR_OVER_S = 1.0
_AS_ASKED = 0.95


class BarrierTimeout(EndoscopeError, TimeoutError):
    """A topic did not answer a tick; the message names it."""


class _Barrier:
    """Streams whose answer a tick waits for: those asked for, and others that answered before."""

    def __init__(self, settings: SimulationClockParameters, ours: Callable[[str], bool]) -> None:
        self._settings, self._ours = settings, ours
        self._answered = dict.fromkeys(FOLLOWED, 0)  # stamps in ns
        self._tracker = SampleClock(settings.tracker_rate)
        self._now_ns = 0
        self.pending: set[str] = set()

    def answer(self, topic: str, data: bytes) -> None:
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        self._answered[topic] = seconds * 1_000_000_000 + nanoseconds
        if self._answered[topic] >= self._now_ns:
            self.pending.discard(topic)

    def begin(self, before: int, now: int) -> None:
        """Wait for a tick; both stamps in ns."""
        self._now_ns = now
        tracked = self._tracker.due(now)
        self.pending.update(self._settings.wait_for)
        for topic, stamp in self._answered.items():
            if self._ours(topic):
                continue
            if topic == SLAVE_MEASURED:
                if tracked and now - stamp < 1.5e9 / self._settings.tracker_rate:
                    self.pending.add(topic)
            elif stamp == before:
                self.pending.add(topic)

    def give_up(self) -> None:
        """Wait only for those asked for."""
        self.pending.intersection_update(self._settings.wait_for)


class _Pace:
    """When the next tick is due, in real time."""

    def __init__(self, period_ns: int) -> None:
        self.period_ns, self._due_ns = period_ns, 0

    def begin(self) -> None:
        self._due_ns = time.monotonic_ns()

    def is_due(self) -> bool:
        """Whether it is, after which the one after it comes a period later."""
        now = time.monotonic_ns()
        if now < self._due_ns:
            return False
        self._due_ns = max(self._due_ns + self.period_ns, now - _DEBT_NS)
        return True


class SimulationClockNode(EndoscopeNode):
    """Publishes ``/clock`` in lock-step with the graph, at most at a pace of ``speed``.

    The next tick comes once every topic of ``wait_for``, and every other stream of another process
    that answered the tick before, has this tick's stamp, and the nodes of this process have dealt
    with all that they sent each other: in one process every message then is a function of
    parameters and seeds alone.
    """

    def __init__(self, context: NodeContext) -> None:
        super().__init__(CLOCK_NODE, context)
        p = self.parameters(SimulationClockParameters)
        self._settings = p
        self._tick_ns = 1_000_000_000 // self.ticker.rate
        period_ns = round(self._tick_ns / p.speed) if p.speed > 0.0 else 0
        self._pace = _Pace(period_ns) if period_ns else None
        self._now_ns = round(p.start * 1e9) - self._tick_ns
        self._until_ns = self._now_ns
        full_name = {topic: self.resolve_topic_name(topic) for topic in FOLLOWED}
        in_flight = self.ticker.in_flight
        self._barrier = _Barrier(p, lambda topic: in_flight.sent_by_us(full_name[topic]))
        self._looked = 0
        self._look_s = min(p.grace, p.timeout) / 2
        self._course: deque[tuple[int, int]] = deque(
            maxlen=round(_FACTOR_OVER_S / self._look_s) + 1
        )
        self._future: Future | None = None
        self.ticks = 0
        self.failure: BarrierTimeout | None = None
        self._clock_out = self.create_publisher(ClockMessage, context.clock, LOCK_STEP)
        in_flight.landed = self._go_on
        for topic in FOLLOWED:
            answer = partial(self._barrier.answer, topic)
            if in_flight.sent_by_us(full_name[topic]):
                # The next tick waits for its readers as it is.
                in_flight.note(full_name[topic], answer)
            else:
                self.create_subscription(
                    JointState, topic, self._going_on(answer), LOCK_STEP, raw=True
                )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(self._look_s, self._look, clock=steady)
        if self._pace is not None:
            self.ticker.paced = True
            self.create_timer(self._pace.period_ns * 1e-9, self._go_on, clock=steady)
        self.diagnostics.add('lock-step', self._report)

    def advance(self, seconds: float) -> Future:
        """Let simulated time go on by `seconds`; the future ends then, or with a BarrierTimeout."""
        self._until_ns = self._now_ns + round(seconds * 1e9)
        self._future = Future()
        self._looked = 0
        if self._pace is not None:
            self._pace.begin()
        if not self._is_waiting:
            self._step()
        return self._future

    @property
    def now_ns(self) -> int:
        """Stamp of the last tick."""
        return self._now_ns

    def _going_on(self, answer: Callable[[bytes], None]) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            waited = len(self._barrier.pending)
            answer(data)
            if len(self._barrier.pending) < waited:
                self._go_on()

        return take

    @property
    def _is_waiting(self) -> bool:
        return bool(self._barrier.pending or self.ticker.in_flight.count)

    def _go_on(self) -> None:
        """Give the next tick if the last one is answered and, where there is a pace, it is due."""
        if self._is_waiting:
            return
        if self._pace is not None:
            if not self._pace.is_due():
                return
            self.ticker.turn_hand()
        self._step()

    def _step(self) -> None:
        if self._now_ns >= self._until_ns:
            future, self._future = self._future, None
            if future is not None and not future.done():
                future.set_result(None)
            return
        before = self._now_ns
        self._now_ns = now = before + self._tick_ns
        self.ticks += 1
        self._barrier.begin(before, now)
        self._looked = 0
        self._clock_out.publish(encode_clock(now))

    def _look(self) -> None:
        """Repeat a tick that may have been lost, give streams up that have ended."""
        self._course.append((time.monotonic_ns(), self._now_ns))
        if self._future is None:
            return
        if not self._is_waiting:
            self._go_on()
            return
        # Time in which this process was not run itself has kept nobody from being heard.
        self._looked += 1
        waited = self._looked * self._look_s
        if waited > self._settings.grace:
            self.ticker.in_flight.give_up()
            self._clock_out.publish(encode_clock(self._now_ns))
            self._barrier.give_up()
            self._go_on()
        if self._barrier.pending and waited > self._settings.timeout:
            self._fail()

    def _fail(self) -> None:
        topics = ', '.join(sorted(self._barrier.pending))
        self.failure = BarrierTimeout(
            f'simulated time stands still at {self._now_ns * 1e-9:.3f} s: waited '
            f'{self._settings.timeout:g} s for {topics}; start the node that publishes it, or '
            f'leave it out of {CLOCK_NODE}.wait_for'
        )
        self.exit_code = 1
        future, self._future = self._future, None
        if future is not None:
            future.set_exception(self.failure)

    @property
    def factor(self) -> float:
        """Simulated seconds in a real one, over the last second or so; NaN before."""
        if len(self._course) < 2:
            return math.nan
        (wall, simulated), (wall_now, simulated_now) = self._course[0], self._course[-1]
        return (simulated_now - simulated) / (wall_now - wall)

    def _report(self) -> Report:
        factor, speed = self.factor, self._settings.speed
        text = 'as fast as this machine can'
        if speed:
            slow = factor < _AS_ASKED * speed
            text = f'at {factor:.2f} of real time, {text}' if slow else f'at {speed:g} of real time'
        return OK, text, {'ticks': self.ticks, FACTOR: factor, 'speed': speed}


class SelfStartingClock(SimulationClockNode):
    """A clock that begins by itself once its topics exist, for a process of its own."""

    def __init__(self, context: NodeContext) -> None:
        super().__init__(context)
        self._process = context
        self._begun = False
        self._waiting_since = time.monotonic()
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(0.5, self._begin, clock=self._steady)

    def _begin(self) -> None:
        if self._begun:
            if self.failure is not None:
                self.get_logger().error(str(self.failure))
                self._process.stop()
            return
        missing = [t for t in self._settings.wait_for if not self.count_publishers(t)]
        if missing or not self._process.connected():
            if time.monotonic() - self._waiting_since > self._settings.timeout:
                self.get_logger().error(f'nobody publishes {", ".join(missing)}')
                self._waiting_since = time.monotonic()
            return
        self._begun = True
        future = self.advance(self._settings.duration or 1e9)
        future.add_done_callback(self._on_end)

    def _on_end(self, future: Future) -> None:
        if future.exception() is None:
            self._process.stop()

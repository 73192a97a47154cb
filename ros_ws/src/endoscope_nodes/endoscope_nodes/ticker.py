"""The 1 kHz beat that all nodes of a process share, in real or in simulated time."""

import struct
import time
from collections.abc import Callable

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage

from endoscope_nodes.qos import CLOCK_ASKED

TICK_NS = 1_000_000
TickCallback = Callable[[int, int], None]

_STAMP = struct.Struct('<iI')


class Ticker:
    """Calls its listeners once a period and says how many periods went by.

    In real time a timer of the steady clock beats; in simulated time each message on ``/clock``
    is a beat, so that a conductor can run the whole graph in lock-step.  One ticker serves all
    nodes of a process, because a timer or a subscription of each node's own would cost more than
    most nodes do.

    Parameters
    ----------
    node
        Hosts the timer or the subscription.
    simulated
        Whether ``/clock`` gives the time.
    period_ns
        Length of a tick in nanoseconds.

    Attributes
    ----------
    ticks, missed
        Beats delivered, and periods that went by without one.
    """

    def __init__(self, node: Node, simulated: bool, period_ns: int = TICK_NS) -> None:
        self._node = node
        self.simulated = simulated
        self.period_ns = period_ns
        self.ticks = 0
        self.missed = 0
        self._listeners: tuple[TickCallback, ...] = ()
        self._periodic: list[_Periodic] = []
        self._clocks: list[Clock] = []
        self._sim_ns = 0
        self._last_ns = 0
        self._timer_started = False
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        # Stamps follow the steady clock from one reading of the system clock: a step of the
        # system clock must not look like a step of the motion.
        self._offset_ns = time.time_ns() - time.monotonic_ns()
        if simulated:
            node.create_subscription(ClockMessage, '/clock', self._on_clock, CLOCK_ASKED, raw=True)

    def now_ns(self) -> int:
        """Time for stamps in nanoseconds; 0 while simulated time has not begun."""
        return self._sim_ns if self.simulated else time.monotonic_ns() + self._offset_ns

    def monotonic_ns(self) -> int:
        """Time for ages and watchdogs: the steady clock, or simulated time."""
        return self._sim_ns if self.simulated else time.monotonic_ns()

    def follow(self, clock: Clock) -> None:
        """Let a node's own clock show the simulated time of this ticker."""
        self._clocks.append(clock)

    def add(self, listener: TickCallback) -> None:
        """Call ``listener(stamp_ns, periods)`` every tick; ``periods`` is 1 if none was missed."""
        self._listeners += (listener,)
        if not self.simulated and not self._timer_started:
            self._timer_started = True
            self._last_ns = time.monotonic_ns()
            self._node.create_timer(self.period_ns * 1e-9, self._on_timer, clock=self._steady)

    def remove(self, listener: TickCallback) -> None:
        """Stop calling a listener."""
        self._listeners = tuple(x for x in self._listeners if x != listener)

    def every(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call ``callback()`` at a slower pace, without asking for the 1 kHz beat."""
        if self.simulated:
            self._periodic.append(_Periodic(round(seconds * 1e9), callback))
        else:
            self._node.create_timer(seconds, callback, clock=self._steady)

    def _on_timer(self) -> None:
        periods = (time.monotonic_ns() - self._last_ns) // self.period_ns
        if periods <= 0:
            return
        self._last_ns += periods * self.period_ns
        self._beat(self._last_ns + self._offset_ns, periods)

    def _on_clock(self, data: bytes) -> None:
        seconds, nanoseconds = _STAMP.unpack_from(data, 4)
        stamp = seconds * 1_000_000_000 + nanoseconds
        if stamp == self._sim_ns or stamp <= 0:
            return
        backwards = stamp < self._sim_ns
        periods = max(1, round((stamp - self._sim_ns) / self.period_ns))
        if backwards or self._sim_ns == 0:
            periods = 1
        if backwards:
            self._node.get_logger().warning('simulated time went back: watches start anew')
            for item in self._periodic:
                item.due_ns = stamp
        self._sim_ns = stamp
        now = Time(nanoseconds=stamp, clock_type=ClockType.ROS_TIME)
        for clock in self._clocks:
            clock.set_ros_time_override(now)  # type: ignore[attr-defined]
        self._beat(stamp, periods)
        for item in self._periodic:
            if stamp >= item.due_ns:
                item.due_ns = stamp + item.period_ns
                item.callback()

    def _beat(self, stamp_ns: int, periods: int) -> None:
        self.ticks += 1
        self.missed += periods - 1
        for listener in self._listeners:
            listener(stamp_ns, periods)


class _Periodic:
    __slots__ = ('callback', 'due_ns', 'period_ns')

    def __init__(self, period_ns: int, callback: Callable[[], None]) -> None:
        self.period_ns = period_ns
        self.callback = callback
        self.due_ns = 0

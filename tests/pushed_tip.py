"""A force at the tip, published beside a graph as its estimate is."""

import math

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from simulated_graph import SimulatedGraph

from endoscope_nodes.names import BOUNDS, DIAGNOSTICS, TIP_FORCE_BOUNDS
from endoscope_nodes.runtime.diagnostics import OK, WARN, diagnostic_array, status
from endoscope_nodes.runtime.qos import EVENT, SENSOR_OFFERED
from endoscope_nodes.runtime.streams import JointPublisher

VISIBLE_N, BOUND_N = 0.08, 0.06
_PERIOD_S, _REPORTED_EVERY, _LATE_NS = 0.025, 40, 100_000_000


class PushedTip:
    """Speaks for `tip_force` in the thread of a graph that has no such node.

    Attributes
    ----------
    force
        Across the tip in N; None to be silent.
    """

    def __init__(self, graph: SimulatedGraph) -> None:
        self.force: tuple[float, float] | None = None
        self._graph, self._count = graph, 0
        probe = graph.probe
        self._bounds = JointPublisher(probe, TIP_FORCE_BOUNDS, BOUNDS, ('effort',), SENSOR_OFFERED)
        self._health = probe.create_publisher(DiagnosticArray, DIAGNOSTICS, EVENT)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = probe.create_timer(_PERIOD_S, self._publish, clock=steady)

    def _publish(self) -> None:
        if self.force is None:
            return
        now_ns, (x, y) = self._graph.clock.now_ns, self.force
        seen = math.hypot(x, y) > VISIBLE_N
        bounds = x - BOUND_N, y - BOUND_N, x + BOUND_N, y + BOUND_N
        self._bounds.publish(now_ns - _LATE_NS, x, y, *bounds, float(seen))
        self._count += 1
        if self._count % _REPORTED_EVERY == 1:
            level, words = (WARN, 'touched') if seen else (OK, 'free')
            values = {'visible [N]': VISIBLE_N}
            report = status('/endoscope/tip_force: force', level, words, values)
            self._health.publish(diagnostic_array(now_ns, report))

    def close(self) -> None:
        """Leave the topics."""
        self._graph.probe.destroy_timer(self._timer)
        self._graph.probe.destroy_publisher(self._health)
        self._bounds.close()

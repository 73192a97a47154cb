"""Nodes in the process of a test, and a test node beside them."""

import time

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from endoscope_core.exit_status import ClosedOnExit
from endoscope_nodes.runtime.runtime import Runtime

_LOOK_S = 0.002


class ProbedRuntime(ClosedOnExit):
    """Serves the nodes, in real time, while the test waits for something.

    Parameters
    ----------
    runtime
        With its nodes; closed with this.
    patience
        So long, in s, something is waited for.

    Attributes
    ----------
    probe
        The test node.
    """

    def __init__(self, runtime: Runtime, patience: float) -> None:
        self.runtime = runtime
        self._patience = patience
        self.probe = Node('probe', context=runtime.context, namespace='endoscope')
        runtime.executor.add_node(self.probe)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)

    def wait(self, condition) -> float:
        """Serve the nodes until something has come true; ``time.monotonic`` then."""
        future = Future()

        def look() -> None:
            if not future.done() and condition():
                future.set_result(None)

        timer = self.probe.create_timer(_LOOK_S, look, clock=self._steady)
        reached = self.runtime.spin_until(future, self._patience)
        self.probe.destroy_timer(timer)
        assert reached, f'it does not come to it: {self.situation()}'
        return time.monotonic()

    def serve(self, seconds: float) -> None:
        """Serve the nodes for a while."""
        self.runtime.spin_until(Future(), seconds)

    def situation(self) -> str:
        """What to report when a wait times out."""
        return ', '.join(node.get_name() for node in self.runtime.nodes)

    def close(self) -> None:
        try:
            self.runtime.executor.remove_node(self.probe)
            self.probe.destroy_node()
        finally:
            self.runtime.close()

"""Nodes in the process of a test, and a test node beside them that commands and hears them."""

import time
from collections import defaultdict

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import Header, String

from endoscope_core.exit_status import ClosedOnExit
from endoscope_nodes.names import MOTION_SESSION, OPERATING_STATE, STATE_COMMAND
from endoscope_nodes.runtime.node_context import all_matched
from endoscope_nodes.runtime.qos import EVENT, RESULT
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


class ProbedGraph(ProbedRuntime):
    """What tests of the simulated graph and of the one with real drivers have in common.

    Parameters
    ----------
    runtime, patience
        As in `ProbedRuntime`.

    Attributes
    ----------
    nodes
        By name.
    states
        Operating states, as they were told.
    session
        Motion session that is open; empty where none is.
    diagnostics
        Statuses of each subcomponent, by its name.
    """

    def __init__(self, runtime: Runtime, patience: float) -> None:
        super().__init__(runtime, patience)
        self.nodes = {node.get_name(): node for node in runtime.nodes}
        self._commands = self.probe.create_publisher(String, STATE_COMMAND, EVENT)
        self.states = []
        self.probe.create_subscription(
            String, OPERATING_STATE, lambda m: self.states.append(m.data), RESULT
        )
        self.session = ''
        self.probe.create_subscription(Header, MOTION_SESSION, self._note_session, EVENT)
        self.diagnostics = defaultdict(list)
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', self._note, EVENT)

    def _note_session(self, message: Header) -> None:
        self.session = message.frame_id

    def _note(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name.removeprefix('/endoscope/')].append(status)

    @property
    def state(self) -> str:
        return self.states[-1] if self.states else ''

    def connect(self) -> None:
        """Wait until all publishers and subscriptions have found each other."""
        self.wait(lambda: all_matched([*self.runtime.nodes, self.probe]))

    def set(self, node: str, **values) -> None:
        """Set parameters of a node."""
        for result in self.nodes[node].set_parameters(
            [Parameter(k, value=v) for k, v in values.items()]
        ):
            assert result.successful, result.reason

    def reported(self, name: str) -> dict[str, str]:
        """Values last reported in the diagnostics of a subcomponent."""
        return {v.key: v.value for v in self.diagnostics[name][-1].values}

    def situation(self) -> str:
        last = {name: told[-1].message for name, told in self.diagnostics.items() if told}
        return f'{self.state!r}, {last}'

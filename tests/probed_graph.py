"""A slave's nodes in the process of a test, which commands them and hears what they report."""

from collections import defaultdict

from diagnostic_msgs.msg import DiagnosticArray
from probed_runtime import ProbedRuntime
from rclpy.parameter import Parameter
from std_msgs.msg import Header, String

from endoscope_nodes.names import MOTION_SESSION, OPERATING_STATE, STATE_COMMAND
from endoscope_nodes.runtime.node_context import all_matched
from endoscope_nodes.runtime.qos import EVENT, RESULT
from endoscope_nodes.runtime.runtime import Runtime


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

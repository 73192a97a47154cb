"""The graph in real time: a simulated slave, read by real drivers from emulated sensors.

The cells and the tracker's sensor show what the simulated slave does, over a serial line, a network
connection or both, and a test breaks what it likes on the way.
"""

import time
from collections import defaultdict
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from recorded_session import private_domain
from std_msgs.msg import String
from std_srvs.srv import Trigger

from endoscope_core.closed_on_exit import ClosedOnExit
from endoscope_nodes.compensator_node import CompensatorNode
from endoscope_nodes.console_node import ConsoleNode
from endoscope_nodes.em_tracker_node import EmTrackerNode
from endoscope_nodes.joint_stream import JointSubscription
from endoscope_nodes.load_cells_node import LoadCellsNode
from endoscope_nodes.matching import all_matched
from endoscope_nodes.motor_driver_node import MotorDriverNode
from endoscope_nodes.names import (
    JOINTS,
    MOTOR_MEASURED,
    MOTORS,
    OPERATING_STATE,
    SIMULATED_BENDING,
    SIMULATED_WIRES,
    SLAVE_MEASURED,
    STATE_COMMAND,
    WIRES,
    WIRES_MEASURED,
)
from endoscope_nodes.qos import EVENT, LOCK_STEP, RESULT
from endoscope_nodes.recorder_node import RecorderNode
from endoscope_nodes.runtime import Runtime
from endoscope_nodes.supervisor_node import SupervisorNode

PATIENCE_S = 30.0
NODES = (
    MotorDriverNode,
    LoadCellsNode,
    EmTrackerNode,
    SupervisorNode,
    CompensatorNode,
    ConsoleNode,
    RecorderNode,
)


class SensorGraph(ClosedOnExit):
    """All that stands between a console and the sensors, and a test node beside it.

    Parameters
    ----------
    bag
        Where everything is recorded.
    cells
        Takes the tension of the simulated wires, if given.
    follow_bending
        Takes the bending of the simulated slave, if given.
    overrides
        Parameter values by node name.
    """

    def __init__(self, bag: Path, *, cells=None, follow_bending=None, **overrides) -> None:
        self.runtime = Runtime(
            ['--ros-args', '--log-level', 'fatal', '-p', 'tick_rate:=500'],
            Context(),
            private_domain(),
            {
                'recorder': {'bag': str(bag)},
                'compensator': {'mode': 'none'},
                **overrides,
            },
        )
        for factory in NODES:
            self.runtime.add(factory)
        self.nodes = {node.get_name(): node for node in self.runtime.nodes}
        self.probe = Node('probe', context=self.runtime.context, namespace='endoscope')
        self.runtime.executor.add_node(self.probe)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._commands = self.probe.create_publisher(String, STATE_COMMAND, EVENT)
        self.states = []
        self.probe.create_subscription(String, OPERATING_STATE, self._note_state, RESULT)
        self.diagnostics = defaultdict(list)
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', self._note, EVENT)
        self.tensions = self.listen(WIRES_MEASURED, WIRES)
        self.bendings = self.listen(SLAVE_MEASURED, JOINTS)
        self.shafts = self.listen(MOTOR_MEASURED, MOTORS)
        if cells is not None:
            self._feed(SIMULATED_WIRES, WIRES, cells.follow)
        if follow_bending is not None:
            self._feed(SIMULATED_BENDING, JOINTS, follow_bending)
        self.wait(lambda: all_matched([*self.runtime.nodes, self.probe]))

    def _feed(self, topic, names, take) -> None:
        JointSubscription(self.probe, topic, names, take, LOCK_STEP)

    def listen(self, topic, names) -> list:
        samples = []
        JointSubscription(
            self.probe,
            topic,
            names,
            lambda sample: samples.append((time.monotonic(), sample)),
            LOCK_STEP,
        )
        return samples

    def _note_state(self, message: String) -> None:
        self.states.append((time.monotonic(), message.data))

    def _note(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name].append(status)

    @property
    def state(self) -> str:
        return self.states[-1][1] if self.states else ''

    def wait(self, condition) -> float:
        """Serve the nodes until something has come true; the time then, in s."""
        future = Future()

        def look() -> None:
            if not future.done() and condition():
                future.set_result(None)

        timer = self.probe.create_timer(0.005, look, clock=self._steady)
        reached = self.runtime.spin_until(future, PATIENCE_S)
        self.probe.destroy_timer(timer)
        assert reached, (self.state, {k: v[-1].message for k, v in self.diagnostics.items()})
        return time.monotonic()

    def serve(self, seconds: float) -> None:
        self.runtime.spin_until(Future(), seconds)

    def command(self, text: str) -> None:
        self._commands.publish(String(data=text))

    def enable(self) -> None:
        """Ask for ENABLED until it is granted, as an operator does."""

        def granted() -> bool:
            if self.state != 'ENABLED':
                self.command('enable')
            return self.state == 'ENABLED'

        self.wait(granted)

    def refused(self, text: str) -> str:
        """Give a command that must be refused; the supervisor's answer.

        It is given again until it is answered: the executor may drop what comes between two spins.
        """
        supervisor = self.nodes['supervisor']
        supervisor._last_refusal = ''
        for _ in range(100):
            self.command(text)
            self.serve(0.05)
            if supervisor._last_refusal:
                break
        assert self.state != 'ENABLED'
        return supervisor._last_refusal

    def play(self) -> None:
        """Let the console move both joints."""
        for result in self.nodes['console'].set_parameters(
            [Parameter('source', value='motion'), Parameter('motion', value='periodic')]
        ):
            assert result.successful, result.reason

    def call(self, node: str, service: str) -> Trigger.Response:
        client = self.probe.create_client(Trigger, f'{node}/{service}')
        self.wait(client.service_is_ready)
        future = client.call_async(Trigger.Request())
        self.wait(future.done)
        return future.result()

    def trouble(self, name: str) -> str:
        """What a subcomponent's last diagnostics say."""
        return self.diagnostics[name][-1].message if self.diagnostics[name] else ''

    def says(self, name: str, words: str) -> None:
        """Wait until a subcomponent's diagnostics, asked for now, contain some words."""
        node = self.nodes[name.partition(':')[0]]

        def said() -> bool:
            node.diagnostics.publish()
            return words in self.trouble(name)

        self.wait(said)

    def figure(self, name: str, key: str) -> str:
        node = self.nodes[name.partition(':')[0]]
        before = len(self.diagnostics[name])
        node.diagnostics.publish()
        self.wait(lambda: len(self.diagnostics[name]) > before)
        return {v.key: v.value for v in self.diagnostics[name][-1].values}[key]

    def close(self) -> None:
        try:
            self.runtime.executor.remove_node(self.probe)
            self.probe.destroy_node()
        finally:
            self.runtime.close()

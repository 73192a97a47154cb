"""The graph in real time: a simulated slave, read by real drivers from emulated sensors.

The cells and the tracker's sensor show what the simulated slave does, over a serial line, a network
connection or both, and a test breaks what it likes on the way.
"""

import time
from pathlib import Path

from probed_graph import ProbedGraph
from rclpy.context import Context
from std_msgs.msg import String
from std_srvs.srv import Trigger

from endoscope_nodes.names import (
    JOINTS,
    MOTOR_MEASURED,
    MOTORS,
    SIMULATED_BENDING,
    SIMULATED_WIRES,
    SLAVE_MEASURED,
    WIRES,
    WIRES_MEASURED,
)
from endoscope_nodes.nodes.compensator import CompensatorNode
from endoscope_nodes.nodes.em_tracker import EmTrackerNode
from endoscope_nodes.nodes.load_cells import LoadCellsNode
from endoscope_nodes.nodes.master import MasterNode
from endoscope_nodes.nodes.motor_driver import MotorDriverNode
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.supervisor import SupervisorNode
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import LOCK_STEP
from endoscope_nodes.runtime.runtime import Runtime
from endoscope_nodes.runtime.streams import JointSubscription

PATIENCE_S = 120.0
NODES = (
    MotorDriverNode,
    LoadCellsNode,
    EmTrackerNode,
    SupervisorNode,
    CompensatorNode,
    MasterNode,
    RecorderNode,
)


class SensorGraph(ProbedGraph):
    """All that stands between the master and the sensors, and a test node beside it.

    Parameters
    ----------
    bag
        Where everything is recorded.
    cells
        Takes the tension of the simulated wires, if given.
    follow_bending
        Takes the bending of the simulated slave, if given.
    nodes
        Factories of the nodes.
    tick_rate
        Beats a second.
    overrides
        Parameter values by node name.
    """

    def __init__(
        self,
        bag: Path,
        *,
        cells=None,
        follow_bending=None,
        nodes=NODES,
        tick_rate: int = 250,
        **overrides,
    ) -> None:
        runtime = Runtime(
            ['--ros-args', '--log-level', 'fatal', '-p', f'tick_rate:={tick_rate}'],
            Context(),
            private_domain(),
            {
                'recorder': {'bag': str(bag)},
                'compensator': {'mode': 'none'},
                **overrides,
            },
        )
        for factory in nodes:
            runtime.add(factory)
        super().__init__(runtime, PATIENCE_S)
        self.tensions = self.listen(WIRES_MEASURED, WIRES)
        self.bendings = self.listen(SLAVE_MEASURED, JOINTS)
        self.shafts = self.listen(MOTOR_MEASURED, MOTORS)
        if cells is not None:
            self._feed(SIMULATED_WIRES, WIRES, cells.follow)
        if follow_bending is not None:
            self._feed(SIMULATED_BENDING, JOINTS, follow_bending)
        self.connect()

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
        before = supervisor._refused
        for _ in range(100):
            self.command(text)
            self.serve(0.05)
            if supervisor._refused is not before:
                break
        assert self.state != 'ENABLED'
        return supervisor._refused.reason

    def play(self) -> None:
        """Let the master move both joints."""
        self.set('master', source='motion', motion='periodic')

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
        return self.reported(name)[key]

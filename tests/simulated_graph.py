"""All nodes in the process of a test, in simulated time that the test lets go on."""

import itertools
import os
from collections import defaultdict

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from endoscope_core.closed_on_exit import ClosedOnExit
from endoscope_nodes.conductor_node import ConductorNode
from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.joint_stream import JointSample, JointSubscription
from endoscope_nodes.matching import all_matched
from endoscope_nodes.names import (
    CALIBRATION_RESULT,
    CALIBRATION_RUN,
    JOINTS,
    OPERATING_STATE,
    STATE_COMMAND,
)
from endoscope_nodes.qos import EVENT, LOCK_STEP, RESULT
from endoscope_nodes.runtime import Runtime

# Domains from 100 on keep away from those of a person; each worker and each graph has its own.
_DOMAINS = itertools.cycle(range(100, 230))
_FIRST = os.getpid() % 130
PATIENCE_S = 120.0


class SimulatedGraph(ClosedOnExit):
    """The whole graph in lock-step, and a test node beside it.

    Parameters
    ----------
    without
        Names of nodes to leave out.
    extra
        Node factories to add.
    overrides
        Parameter values by node name.
    """

    def __init__(self, *, without=(), extra=(), overrides=None) -> None:
        domain = (next(_DOMAINS) + _FIRST) % 130 + 100
        self.runtime = Runtime(
            args=['--ros-args', '-p', 'use_sim_time:=true', '--log-level', 'fatal'],
            context=Context(),
            domain_id=domain,
            overrides=overrides,
        )
        for factory in (*SLAVE_NODES, *CONTROL_NODES, *extra, ConductorNode):
            if factory.__module__.rpartition('.')[2].removesuffix('_node') not in without:
                self.runtime.add(factory)
        self.nodes = {node.get_name(): node for node in self.runtime.nodes}
        self.runtime.check_parameters()
        self.domain = domain
        self.conductor = self.nodes['conductor']
        self.probe = Node('probe', context=self.runtime.context, namespace='endoscope')
        self.runtime.executor.add_node(self.probe)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._commands = self.probe.create_publisher(String, STATE_COMMAND, EVENT)
        self.states = []
        self.probe.create_subscription(
            String, OPERATING_STATE, lambda m: self.states.append(m.data), RESULT
        )
        self.results = []
        self.probe.create_subscription(
            DiagnosticArray, CALIBRATION_RESULT, self.results.append, RESULT
        )
        self.diagnostics = defaultdict(list)
        self.probe.create_subscription(DiagnosticArray, '/diagnostics', self._note, EVENT)
        self._run = self.probe.create_client(Trigger, CALIBRATION_RUN)
        self.connect()

    def _note(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.diagnostics[status.name].append(status)

    def listen(self, topic: str, names=JOINTS) -> list[JointSample]:
        """Collect all samples of a topic from now on.

        Ask before the topic speaks where each sample counts: who joins a running stream may miss
        its next message.
        """
        samples: list[JointSample] = []
        JointSubscription(self.probe, topic, names, samples.append, LOCK_STEP)
        self.connect()
        return samples

    def speak(self, kind: type, topic: str, qos: QoSProfile):
        """Publish on a topic from the test."""
        publisher = self.probe.create_publisher(kind, topic, qos)
        self.connect()
        return publisher

    def connect(self) -> None:
        """Wait until all publishers and subscriptions have found each other."""
        self.wait(lambda: all_matched([*self.runtime.nodes, self.probe]))

    def wait(self, condition) -> None:
        """Serve the nodes in real time until something has come true."""
        future = Future()

        def look() -> None:
            if not future.done() and condition():
                future.set_result(None)

        timer = self.probe.create_timer(0.002, look, clock=self._steady)
        assert self.runtime.spin_until(future, PATIENCE_S), 'the graph does not come to it'
        self.probe.destroy_timer(timer)

    def advance(self, seconds: float) -> None:
        """Let simulated time go on."""
        future = self.conductor.advance(seconds)
        assert self.runtime.spin_until(future, PATIENCE_S), 'simulated time stands still'
        future.result()
        # The tick is over for the nodes that time waits for; the others may have mail left.
        self.wait(lambda: True)

    def command(self, text: str) -> str:
        """Give a state command; the state after it."""
        self._commands.publish(String(data=text))
        self.advance(0.02)
        return self.states[-1]

    def enable(self) -> None:
        """Bring the slave to ENABLED."""
        self.advance(0.1)
        state = self.command('enable')
        assert state == 'ENABLED', self.nodes['supervisor'].machine.present_causes

    def call_calibration(self) -> Trigger.Response:
        """Ask for a calibration; the answer, which comes at once."""
        future = self._run.call_async(Trigger.Request())
        self.wait(future.done)
        return future.result()

    def calibrate(self) -> dict[str, str]:
        """Calibrate to the end; the values of the result."""
        answer = self.call_calibration()
        assert answer.success, answer.message
        self.advance(13.0)
        status = self.results[-1].status[0]
        assert status.level == b'\x00', status.message
        return {v.key: v.value for v in status.values}

    def kill(self, name: str) -> None:
        """Let a node vanish without a last word, as SIGKILL does."""
        node = self.nodes.pop(name)
        node.close = lambda: None
        self.runtime.remove(node)

    def set(self, node: str, **values) -> None:
        """Set parameters of a node."""
        for result in self.nodes[node].set_parameters(
            [Parameter(k, value=v) for k, v in values.items()]
        ):
            assert result.successful, result.reason

    def reported(self, name: str) -> dict[str, str]:
        """Values last reported in the diagnostics of a subcomponent."""
        return {v.key: v.value for v in self.diagnostics[name][-1].values}

    def close(self) -> None:
        try:
            self.runtime.executor.remove_node(self.probe)
            self.probe.destroy_node()
        finally:
            self.runtime.close()

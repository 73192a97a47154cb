"""All nodes in the process of a test, in simulated time that the test lets go on."""

from diagnostic_msgs.msg import DiagnosticArray
from probed_graph import ProbedGraph
from rclpy.context import Context
from rclpy.qos import QoSProfile
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from endoscope_nodes.graph import CONTROL_NODES, SLAVE_NODES
from endoscope_nodes.names import (
    CALIBRATION_RESULT,
    CALIBRATION_RUN,
    JOINTS,
)
from endoscope_nodes.nodes.simulation_clock import SimulationClockNode
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import LOCK_STEP, RESULT
from endoscope_nodes.runtime.runtime import Runtime
from endoscope_nodes.runtime.streams import JointSample, JointSubscription

PATIENCE_S = 120.0
TICK_RATE = 125
"""Hz: an eighth of what the nodes beat at by themselves, at an eighth of the cost."""
LONGEST_CALIBRATION_S = 13
# Twice as many messages as ever follow from each other in a tick: handle, command, goal, wires.
_LONGEST_CHAIN = 8
FACTORIES = (*SLAVE_NODES, *CONTROL_NODES)


class SimulatedGraph(ProbedGraph):
    """The whole graph in lock-step, and a test node beside it.

    Parameters
    ----------
    without
        Names of nodes to leave out.
    extra
        Node factories to add.
    overrides
        Parameter values by node name.
    rig
        What stands on the table, instead of the shipped one.
    tick_rate
        Ticks of simulated time in a second of it.
    """

    def __init__(
        self, *, without=(), extra=(), overrides=None, rig=None, tick_rate=TICK_RATE, args=()
    ) -> None:
        self.domain = private_domain()
        overrides = overrides or {}
        # A busy machine may keep the nodes from answering a tick for long.
        clock = {'timeout': PATIENCE_S} | overrides.get('simulation_clock', {})
        runtime = Runtime(
            args=[
                *('--ros-args', '--log-level', 'fatal'),
                *('-p', 'use_sim_time:=true', '-p', f'tick_rate:={tick_rate}'),
                *args,
            ],
            context=Context(),
            domain_id=self.domain,
            overrides=overrides | {'simulation_clock': clock},
            rig=rig,
        )
        for factory in (*SLAVE_NODES, *CONTROL_NODES, *extra, SimulationClockNode):
            if node_name(factory) not in without:
                runtime.add(factory)
        runtime.check_parameters()
        super().__init__(runtime, PATIENCE_S)
        self.clock = self.nodes['simulation_clock']
        self.results = []
        self.probe.create_subscription(
            DiagnosticArray, CALIBRATION_RESULT, self.results.append, RESULT
        )
        self._run = self.probe.create_client(Trigger, CALIBRATION_RUN)
        self.connect()

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

    def advance(self, seconds: float) -> None:
        """Let simulated time go on."""
        left = round(seconds * 1e6)
        while left > 0:
            # A second at a time, so that what is waited for does not grow with the motion.
            slice_us = min(left, 1_000_000)
            left -= slice_us
            future = self.clock.advance(slice_us * 1e-6)
            assert self.runtime.spin_until(future, PATIENCE_S), 'simulated time stands still'
            future.result()
        # The tick is over for the nodes that time waits for; the others may have mail left.
        self._read_mail(_LONGEST_CHAIN)

    def _read_mail(self, turns: int) -> None:
        """Serve what is there now, then what that has sent, and so on.

        Within a process whatever is sent is in the mail of its readers at once.
        """
        done = Future()

        def turn(left: int) -> None:
            if left:
                self.runtime.executor.create_task(turn, left - 1)
            else:
                done.set_result(None)

        turn(turns)
        assert self.runtime.spin_until(done, PATIENCE_S)

    def command(self, text: str) -> str:
        """Give a state command; the state after it."""
        self._commands.publish(String(data=text))
        self.advance(0.02)
        # The state is told at the supervisor's own beat, of which the first may be yet to come.
        while not self.states:
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
        known = len(self.results)
        for _ in range(LONGEST_CALIBRATION_S):
            self.advance(1.0)
            if len(self.results) > known:
                break
        status = self.results[-1].status[0]
        assert status.level == b'\x00', f'{status.message}: {self.cause}'
        return {v.key: v.value for v in status.values}

    @property
    def cause(self) -> str:
        """Why the slave is in FAULT."""
        return self.nodes['supervisor'].machine.cause

    def kill(self, name: str) -> None:
        """Let a node vanish without a last word, as SIGKILL does."""
        node = self.nodes.pop(name)
        node.close = lambda: None
        self.runtime.remove(node)

    def start(self, name: str) -> None:
        """Start a node that was killed anew."""
        factory = next(f for f in FACTORIES if node_name(f) == name)
        self.nodes[name] = self.runtime.add(factory)
        self.connect()


def node_name(factory: type) -> str:
    """Name of the node that a class makes, by its module."""
    return factory.__module__.rpartition('.')[2]

"""Nodes as processes of their own: what they do together, how they stop, what they refuse."""

import os
import signal
import subprocess
import sys
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from node_program import code_of
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from endoscope_lab.faults.node_processes import NODES as ALL_BUT_SHOWN
from endoscope_nodes.program import PROGRAMS
from endoscope_nodes.runtime.private_domain import private_domain
from endoscope_nodes.runtime.qos import EVENT, SENSOR_ASKED

DOMAIN = private_domain()
NODES = tuple(node for node in ALL_BUT_SHOWN if node != 'recorder')
PATIENCE_S = 300.0
RIG = 'timeouts: {command: 1.0, stream: 10.0, handle: 1.0}'
"""Time-outs that a busy machine can keep."""


def start(program, *args):
    return subprocess.Popen(
        [sys.executable, '-c', code_of(program), '--ros-args', *args],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {'ROS_DOMAIN_ID': str(DOMAIN)},
    )


class Operator:
    """Listens to the processes from outside, and gives state commands."""

    def __init__(self):
        self._context = Context()
        rclpy.init(args=[], context=self._context, domain_id=DOMAIN)
        self._node = rclpy.create_node('operator', context=self._context, namespace='endoscope')
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self.heard = set()
        self.reach = 0.0
        self.commands = self._node.create_publisher(String, 'slave/state_command', EVENT)
        self._node.create_subscription(DiagnosticArray, '/diagnostics', self._on_health, EVENT)
        self._node.create_subscription(
            JointState, 'motor/measured_js', self._on_motors, SENSOR_ASKED
        )

    def _on_health(self, message):
        self.heard |= {
            status.name.removeprefix('/endoscope/').partition(':')[0] for status in message.status
        }

    def _on_motors(self, message):
        self.reach = max(self.reach, abs(message.position[0]))

    def wait_until(self, condition, repeated=lambda: None):
        deadline = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline, f'heard {sorted(self.heard)}, reach {self.reach}'
            repeated()
            again = time.monotonic() + 0.5
            while time.monotonic() < again:
                self._executor.spin_once(timeout_sec=0.1)

    def close(self):
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.shutdown()


@pytest.fixture
def operator():
    operator = Operator()
    yield operator
    operator.close()


def stop(process, number):
    process.send_signal(number)
    out, errors = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, errors
    assert 'Traceback' not in out + errors


@pytest.fixture
def rig(tmp_path):
    (tmp_path / 'rig.yaml').write_text(RIG)
    return ['-p', f'rig_file:={tmp_path / "rig.yaml"}', '-p', 'tick_rate:=100']


@pytest.mark.nightly
def test_each_node_is_a_process_and_stops_cleanly(operator, rig):
    plays = {'master': ['-p', 'source:=motion']}
    processes = {node: start(PROGRAMS[node].name, *rig, *plays.get(node, [])) for node in NODES}
    try:
        operator.wait_until(lambda: operator.heard >= set(NODES))
        operator.wait_until(
            lambda: operator.reach > 0.2, lambda: operator.commands.publish(String(data='enable'))
        )
        for k, node in enumerate(NODES):
            stop(processes.pop(node), (signal.SIGTERM, signal.SIGINT)[k % 2])
    finally:
        for process in processes.values():
            process.kill()
            process.communicate()


def test_the_whole_graph_in_motion_stops_cleanly(operator, rig, tmp_path):
    bag = tmp_path / 'bag'
    params = tmp_path / 'console.yaml'
    params.write_text('/**/master: {ros__parameters: {source: motion}}\n')
    process = start('graph', '--params-file', str(params), '-p', f'bag:={bag}', *rig)
    try:
        operator.wait_until(
            lambda: operator.reach > 0.2, lambda: operator.commands.publish(String(data='enable'))
        )
        stop(process, signal.SIGINT)
    finally:
        process.kill()
        process.communicate()
    assert (bag / 'metadata.yaml').is_file()

"""Following a console handle while the clutch is held."""

import numpy as np
import pytest
from sensor_msgs.msg import JointState, Joy
from simulated_graph import SimulatedGraph

from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, MASTER_MEASURED
from endoscope_nodes.qos import EVENT, SENSOR_OFFERED

# In real time, on a machine that may stall for longer than a device may be silent.
pytestmark = pytest.mark.flaky(reruns=2)


class Handle:
    """A handle at 200 Hz with a clutch at 10 Hz."""

    def __init__(self, graph):
        self._graph = graph
        self._handle = graph.speak(JointState, MASTER_MEASURED, SENSOR_OFFERED)
        self._clutch = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        self.angle = np.array([0.5, -0.3])
        self._count = 0

    def move(self, seconds, speed, clutch=True, alive=True):
        for _ in range(round(seconds * 200)):
            self.angle = self.angle + np.array(speed) / 200
            if alive:
                self._send(clutch)
            self._graph.advance(0.005)

    def _send(self, clutch):
        stamp = divmod(self._graph.conductor.now_ns, 1_000_000_000)
        message = JointState(name=list(JOINTS), position=self.angle.tolist())
        message.header.stamp.sec, message.header.stamp.nanosec = stamp
        self._handle.publish(message)
        if self._count % 20 == 0:
            joy = Joy(buttons=[int(clutch)])
            joy.header.stamp.sec, joy.header.stamp.nanosec = stamp
            self._clutch.publish(joy)
        self._count += 1


@pytest.fixture
def graph():
    overrides = {'console': {'source': 'master', 'scale': 0.5}}
    with SimulatedGraph(overrides=overrides) as graph:
        graph.enable()
        yield graph


def test_engaging_re_references_without_a_jump(graph):
    commands = graph.listen('slave/servo_jp')
    handle = Handle(graph)
    handle.move(0.4, (0.5, 0.0))
    first = commands[-1].position
    assert commands[0].position == pytest.approx((0.0, 0.0), abs=1e-6)
    assert 0.05 < first[0] < 0.11
    handle.move(0.3, (2.0, 2.0), clutch=False)
    released = len(commands)
    handle.move(0.2, (2.0, 2.0), clutch=False)
    assert len(commands) == released
    handle.move(0.4, (0.0, 0.5))
    assert commands[released].position == pytest.approx(commands[released - 1].position, abs=0.006)
    steps = np.abs(np.diff([c.position for c in commands], axis=0))
    assert steps.max() < 0.006


def test_a_dead_console_means_standing_still(graph):
    commands = graph.listen('slave/servo_jp')
    shafts = graph.listen('motor/measured_js', ('motor_x', 'motor_y'))
    handle = Handle(graph)
    handle.move(0.5, (0.5, 0.5))
    before = len(commands)
    handle.move(1.0, (3.0, 3.0), alive=False)
    assert len(commands) - before < 110
    assert np.ptp([s.position for s in shafts[-500:]], axis=0).max() < 0.002

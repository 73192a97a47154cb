"""Commands that must not be obeyed, sent into the running graph by somebody else."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import JointState, Joy
from simulated_graph import SimulatedGraph

from endoscope_nodes.names import JOINTS, MASTER_CLUTCH, SLAVE_COMMAND
from endoscope_nodes.qos import COMMAND, EVENT

# In real time, on a machine that may stall for longer than a device may be silent.
pytestmark = pytest.mark.flaky(reruns=2)


class ForeignConsole:
    """Publishes ``slave/servo_jp`` with ordinary messages, as somebody else's program does."""

    def __init__(self, graph):
        self._graph = graph
        self._publisher = graph.speak(JointState, SLAVE_COMMAND, COMMAND)
        self._clutch = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        self._sent = 0
        self.clutch = 1
        self.angle = 0.0

    def send(self, **changes):
        message = JointState(name=list(JOINTS), position=[self.angle] * 2, velocity=[0.5] * 2)
        stamp = self._graph.conductor.now_ns + changes.pop('late_ns', 0)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 1_000_000_000)
        for field, value in changes.items():
            setattr(message, field, value)
        if self._sent % 100 == 0:
            self.hold(self.clutch)
        self._sent += 1
        self._publisher.publish(message)
        self._graph.advance(0.001)

    def hold(self, clutch):
        self.clutch = clutch
        if clutch is not None:
            self._clutch.publish(Joy(buttons=[clutch]))
            self._graph.advance(0.001)

    def move(self, ticks):
        for _ in range(ticks):
            self.angle += 0.0005
            self.send()


@pytest.fixture
def graph():
    with SimulatedGraph(without=('console',)) as graph:
        graph.enable()
        yield graph


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'position': [math.nan, 0.0]}, 'not finite'),
        ({'velocity': [0.0, math.inf]}, 'not finite'),
        ({'late_ns': -300_000_000}, 'stamp not increasing'),
        ({'name': ['bend_x', 'elbow']}, 'malformed'),
        ({'name': ['bend_x'], 'position': [0.0], 'velocity': [0.0]}, 'malformed'),
        ({'position': [0.0], 'velocity': []}, 'malformed'),
        ({'position': [3.0, 0.0]}, 'out of range'),
        ({'position': [0.8, 0.0]}, 'too fast'),
    ],
)
def test_a_bad_command_is_refused_counted_and_changes_nothing(graph, changes, reason):
    console = ForeignConsole(graph)
    drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
    console.move(100)
    good = len(drives)
    console.send(**changes)
    assert len(drives) == good
    console.move(100)
    graph.advance(1.1)
    assert len(drives) == good + 100
    assert graph.reported('compensator: commands')[f'refused: {reason}'] == '1'
    steps = np.abs(np.diff([d.position for d in drives], axis=0))
    assert steps.max() < 0.002


def test_a_late_command_is_refused_where_its_stamp_is_in_order(graph):
    console = ForeignConsole(graph)
    console.move(50)
    graph.advance(0.5)
    console.hold(1)
    console.send(late_ns=-300_000_000)
    graph.advance(1.1)
    assert graph.reported('compensator: commands')['refused: late'] == '1'


def test_the_order_of_the_joints_does_not_matter(graph):
    console = ForeignConsole(graph)
    drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
    console.move(20)
    angle = console.angle
    console.send(name=['bend_y', 'bend_x'], position=[angle + 0.001, angle])
    assert len(drives) == 21
    assert (
        drives[-1].position[1] - drives[-2].position[1]
        > drives[-1].position[0] - (drives[-2].position[0])
    )


def test_without_commands_the_measured_position_is_held(graph):
    console = ForeignConsole(graph)
    console.move(300)
    shafts = graph.listen('motor/measured_js', ('motor_x', 'motor_y'))
    graph.advance(1.2)
    positions = np.array([s.position for s in shafts])
    assert np.ptp(positions[200:], axis=0).max() < 0.004
    assert graph.reported('motor_driver: device')['holding'] == 'True'
    assert graph.reported('motor_driver: device')['times held'] == '1'


def test_nothing_moves_unless_enabled(graph):
    assert graph.command('disable') == 'DISABLED'
    console = ForeignConsole(graph)
    drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
    shafts = graph.listen('motor/measured_js', ('motor_x', 'motor_y'))
    console.move(100)
    graph.advance(1.1)
    assert drives == []
    assert graph.reported('compensator: commands')['refused: not enabled'] == '100'
    assert np.ptp([s.position for s in shafts], axis=0).max() < 0.002


@pytest.mark.parametrize('clutch', [0, None], ids=['released', 'never heard of'])
def test_nothing_moves_unless_the_clutch_is_held(graph, clutch):
    console = ForeignConsole(graph)
    console.clutch = clutch
    drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
    console.move(100)
    assert drives == []
    graph.advance(1.1)
    assert graph.reported('compensator: commands')['refused: clutch not held'] == '100'
    console.hold(1)
    console.move(10)
    assert len(drives) == 10


def test_a_clutch_that_falls_silent_is_released(graph):
    console = ForeignConsole(graph)
    drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
    console.move(20)
    console.clutch = None
    console.move(600)
    assert 340 <= len(drives) <= 380

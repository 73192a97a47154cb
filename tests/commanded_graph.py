"""The simulated graph, what sends to it from outside, and what it has moved since."""

import numpy as np
import pytest
from rclpy.time import Time
from sensor_msgs.msg import JointState, Joy
from simulated_graph import SimulatedGraph

from endoscope_core.rig import load_rig
from endoscope_nodes.names import (
    JOINTS,
    MASTER_CLUTCH,
    MASTER_MEASURED,
    MOTOR_COMMAND,
    MOTORS,
    SLAVE_COMMAND,
)
from endoscope_nodes.runtime.qos import COMMAND, EVENT, SENSOR_OFFERED

RIG = load_rig()
TICK_RATE = 250
"""Hz: what a tick may change is held at a quarter of what the nodes beat at by themselves."""
# What a goal of the shafts may change in a tick: the shaper's speed, and rounding.
TICK_S = 1.0 / TICK_RATE
BOUND = RIG.motors.speed * TICK_S * 1.001
STILL = 0.003


def ticks(seconds):
    """Ticks that the graph has in some time, s."""
    return round(seconds * TICK_RATE)


class Sender:
    """Publishes JointStates from the test, as somebody else's program does."""

    def __init__(self, graph, topic, names=JOINTS, qos=COMMAND):
        self._graph = graph
        self._names = names
        self.publisher = graph.speak(JointState, topic, qos)

    def send(self, position, session=None, ahead_ns=0, **fields):
        message = JointState(name=list(self._names), position=list(position))
        stamp = self._graph.clock.now_ns + ahead_ns
        message.header.stamp = Time(nanoseconds=stamp).to_msg()
        message.header.frame_id = self._graph.session if session is None else session
        for field, value in fields.items():
            setattr(message, field, value)
        self.publisher.publish(message)


class ForeignMaster(Sender):
    """Writes ``slave/servo_jp`` while the master's source is ``none``."""

    def __init__(self, graph):
        super().__init__(graph, SLAVE_COMMAND)
        self.clutch_publisher = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        self.sent = 0
        self.clutch = 1
        self.start = graph.nodes['compensator']._pose.bending()
        self.way = 0.0
        self.towards = -1.0 if self.start[0] > 0.0 else 1.0

    @property
    def angle(self):
        """What it asks for, rad, from where the slave is at first."""
        return [start + self.way for start in self.start]

    def tick(self, position=None, **changes):
        if self.sent % ticks(0.1) == 0 and self.clutch is not None:
            self.clutch_publisher.publish(Joy(buttons=[self.clutch]))
            self._graph.advance(TICK_S)
        self.sent += 1
        self.send(self.angle if position is None else position, **changes)
        self._graph.advance(TICK_S)

    def hold(self, clutch):
        self.clutch = clutch
        self.clutch_publisher.publish(Joy(buttons=[clutch]))
        self._graph.advance(TICK_S)

    def move(self, seconds, speed=0.5):
        for _ in range(ticks(seconds)):
            self.way += TICK_S * speed * self.towards
            self.tick(velocity=[speed * self.towards] * 2)


class Handle(Sender):
    """A handle with a clutch at 10 Hz."""

    def __init__(self, graph, rate=200):
        super().__init__(graph, MASTER_MEASURED, qos=SENSOR_OFFERED)
        self.clutch_publisher = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        self.rate = rate
        self._count = 0
        self.angle = np.array([0.5, -0.3])

    def move(self, seconds, speed=(0.0, 0.0), clutch=True, alive=True):
        for _ in range(round(seconds * self.rate)):
            self.angle = self.angle + np.array(speed) / self.rate
            if alive:
                self.send(self.angle, session='')
            if alive and self._count % (self.rate // 10) == 0:
                self.clutch_publisher.publish(Joy(buttons=[int(clutch)]))
            self._count += 1
            self._graph.advance(1.0 / self.rate)


class Moved:
    """What goals and shafts have done since."""

    def __init__(self, graph):
        self._graph, self._clock = graph, graph.clock
        self.goals = graph.listen(MOTOR_COMMAND, MOTORS)
        self.shafts = graph.listen('motor/measured_js', MOTORS)
        self._bending = graph.listen('simulation/bending')
        self.clear()

    def clear(self):
        # What was measured before may come later still.
        self._since_ns = self._clock.now_ns
        for samples in (self.goals, self.shafts, self._bending):
            samples.clear()

    @property
    def of_shafts(self):
        return self._way(self.shafts)

    @property
    def of_tip(self):
        return self._way(self._bending)

    def _way(self, samples):
        # Who joins a running stream may be given its first samples late, and all at once.
        lately_ns = self._clock.now_ns - 2 * round(TICK_S * 1e9)
        self._graph.wait(lambda: samples and samples[-1].stamp_ns >= lately_ns)
        since = [s.position for s in samples if s.stamp_ns >= self._since_ns]
        return float(np.ptp(since, axis=0).max())

    @property
    def largest_step(self):
        """Of goals that follow each other, and of shafts beyond a count in a millisecond, rad."""
        steps = [0.0]
        for samples, count in ((self.goals, 0.0), (self.shafts, RIG.handle.resolution)):
            if len(samples) > 1:
                step = np.abs(np.diff([s.position for s in samples], axis=0)).max()
                steps.append(float(step) - count)
        return max(steps)


def run(**arguments):
    """The graph, enabled."""
    graph = SimulatedGraph(tick_rate=TICK_RATE, **arguments)
    graph.enable()
    return graph


@pytest.fixture(scope='module')
def foreign():
    """A graph whose master is silent, for tests that leave it as they found it."""
    with run() as graph:
        yield graph


@pytest.fixture
def master(foreign):
    """The foreign master, in a session of its own and at the pose of then."""
    foreign.command('disable')
    foreign.advance(0.5)
    foreign.enable()
    master = ForeignMaster(foreign)
    yield master
    foreign.probe.destroy_publisher(master.publisher)
    foreign.probe.destroy_publisher(master.clutch_publisher)
    foreign.command('disable')
    foreign.advance(0.1)

"""Velocities of other programs move the slave while they may, and strangers move nothing.

In simulated time, so that every instant is the same in every run.
"""

import math

import numpy as np
import pytest
from commanded_graph import RIG, STILL, TICK_S, Moved, Sender, run, ticks
from geometry_msgs.msg import Twist, TwistStamped, Vector3
from rclpy.time import Time
from sensor_msgs.msg import JointState, Joy
from simulated_graph import TICK_RATE
from std_srvs.srv import Trigger

from endoscope_core.safety import Refusal
from endoscope_nodes.names import (
    MASTER_CLUTCH,
    SLAVE_COMMAND,
    SLAVE_HOME,
    SLAVE_STOP,
    SLAVE_VELOCITY,
    TIP_VELOCITY,
)
from endoscope_nodes.runtime.diagnostics import OK, WARN
from endoscope_nodes.runtime.qos import COMMAND, EVENT

TOPICS = {SLAVE_COMMAND: JointState, SLAVE_VELOCITY: JointState, TIP_VELOCITY: TwistStamped}


class Stick:
    """A program that commands velocities on one topic, every 20 ms, and holds the clutch."""

    def __init__(self, graph, topic=SLAVE_VELOCITY, clutch=1):
        self.graph, self.topic = graph, topic
        self.publisher = graph.speak(TOPICS[topic], topic, COMMAND)
        self.clutch = clutch
        if clutch is not None:
            self.clutch_publisher = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        # The master takes the sender up, and is found as the sender of what it makes of this.
        graph.advance(0.1)
        graph.connect()

    def message(self, velocity, session=None, ahead_ns=0):
        if self.topic == TIP_VELOCITY:
            linear, angular = velocity
            message = TwistStamped(
                twist=Twist(linear=Vector3(**linear), angular=Vector3(**angular))
            )
        else:
            message = JointState(name=['bend_x', 'bend_y'], velocity=list(velocity))
        message.header.stamp = Time(nanoseconds=self.graph.clock.now_ns + ahead_ns).to_msg()
        message.header.frame_id = self.graph.session if session is None else session
        return message

    def grip(self):
        if self.clutch is not None:
            self.clutch_publisher.publish(Joy(buttons=[self.clutch]))
            self.graph.advance(TICK_S)

    def move(self, seconds, velocity, **how):
        for k in range(round(seconds / 0.02)):
            if k % 5 == 0:
                self.grip()
            self.publisher.publish(self.message(velocity, **how))
            self.graph.advance(0.02)

    def leave(self):
        for publisher in (self.publisher, self.clutch_publisher):
            self.graph.probe.destroy_publisher(publisher)
        self.graph.command('disable')
        self.graph.advance(0.3)


@pytest.fixture(scope='module')
def graph():
    with run() as graph:
        graph.desired = graph.listen(SLAVE_COMMAND)
        yield graph


@pytest.fixture
def stick(graph, request):
    """A stick on a topic, in a session of its own."""
    stick = Stick(graph, getattr(request, 'param', SLAVE_VELOCITY))
    graph.enable()
    graph.desired.clear()
    yield stick
    stick.leave()


def travel(samples):
    return np.subtract(samples[-1].position, samples[0].position)


def test_it_moves_as_fast_as_asked_and_falls_silent_as_positions_do(graph, stick):
    stick.move(1.0, (0.4, -0.2))
    assert travel(graph.desired) == pytest.approx((0.4, -0.2), abs=0.02)
    assert graph.desired[-1].velocity == pytest.approx((0.4, -0.2))
    graph.advance(0.12)
    assert graph.desired[-1].velocity == pytest.approx((0.4, -0.2))
    graph.advance(0.1)
    assert graph.state == 'FAULT'
    assert 'slave/servo_jv ended while the clutch was held' in graph.cause
    steps = np.diff([d.velocity for d in graph.desired], axis=0)
    assert np.abs(steps).max() <= 1.001 * RIG.joints.acceleration * TICK_S
    assert graph.desired[-1].velocity == (0.0, 0.0)
    graph.advance(0.2)
    moved = Moved(graph)
    stick.move(0.5, (0.4, -0.2))
    assert moved.goals == []
    assert moved.of_shafts < STILL


@pytest.mark.parametrize('stick', [TIP_VELOCITY], indirect=True)
def test_the_tip_turns_and_moves_in_its_own_frame(graph, stick):
    stick.move(0.5, ({}, {'x': 0.4}))
    assert travel(graph.desired) == pytest.approx((0.0, -0.2), abs=0.02)
    graph.desired.clear()
    stick.move(0.5, ({'x': 4e-3, 'z': 1e-3}, {}))
    across = 4e-3 / (0.5 * RIG.instrument.section_length)
    assert travel(graph.desired)[0] == pytest.approx(0.5 * across, abs=0.02)
    stick.move(1.1, ({'x': 0.0, 'z': 1e-3}, {}))
    told = graph.diagnostics['master: velocities'][-1]
    assert told.level == WARN
    assert told.message.endswith('ignored, for the tip bends by two angles: linear.z')


STRANGE = (
    ({'velocity': (0.5, 0.5), 'session': ''}, Refusal.SESSION),
    ({'velocity': (0.5, 0.5), 'session': 'session-1'}, Refusal.SESSION),
    ({'velocity': (math.nan, 0.5)}, Refusal.NOT_FINITE),
    ({'velocity': (1.001 * RIG.joints.hand_speed, 0.0)}, Refusal.RANGE),
    ({'velocity': (0.5,)}, Refusal.MALFORMED),
    ({'velocity': ()}, Refusal.MALFORMED),
)


def test_a_stranger_moves_nothing_and_is_counted(graph, stick):
    moved, refused = Moved(graph), graph.nodes['master'].motion.velocities.gate.refused
    for how, reason in STRANGE:
        before = refused[reason]
        stick.move(0.1, **how)
        assert refused[reason] == before + 5, reason
    for clutch in (0, None):
        stick.clutch = clutch
        before = refused[Refusal.CLUTCH]
        graph.advance(0.4)
        stick.move(0.1, (0.5, 0.5))
        assert refused[Refusal.CLUTCH] == before + 5
    assert graph.state == 'ENABLED'
    graph.command('disable')
    stick.clutch = 1
    stick.move(0.4, (0.5, 0.5))
    assert moved.goals == []
    assert graph.desired == []
    assert moved.of_shafts < STILL


def test_what_is_too_fast_with_the_clutch_held_is_a_fault_and_said(graph, stick):
    moved = Moved(graph)
    stick.move(0.6, (0.0, 5.0))
    assert graph.state == 'FAULT'
    assert 'commands are refused, last: out of range: 5 rad/s beyond 3' in graph.cause
    assert moved.goals == []


def test_it_stops_when_the_clutch_is_let_go_and_begins_where_the_slave_is(graph, stick):
    stick.move(0.6, (0.5, 0.0))
    stick.clutch = 0
    stick.grip()
    moved = Moved(graph)
    stick.move(0.5, (0.5, 0.0))
    assert moved.goals == []
    assert moved.of_shafts < 0.02
    graph.desired.clear()
    stick.clutch = 1
    stick.move(0.4, (0.5, 0.0))
    pose = graph.nodes['master'].motion.where
    assert graph.desired[0].position[0] < graph.desired[-1].position[0]
    assert graph.desired[0].position == pytest.approx(pose, abs=0.25)
    assert graph.state == 'ENABLED'


@pytest.mark.parametrize('topic', TOPICS)
def test_a_second_sender_of_motion_on_any_topic_is_a_fault_that_names_both(graph, stick, topic):
    stick.move(0.3, (0.4, 0.0))
    rival = graph.speak(TOPICS[topic], topic, COMMAND)
    moved = Moved(graph)
    stick.move(0.1, (0.4, 0.0))
    assert graph.state == 'FAULT'
    assert graph.cause.count('/endoscope/') == 2
    assert topic in graph.cause
    moved.clear()
    stick.move(0.4, (0.4, 0.0))
    assert moved.goals == []
    assert graph.command('enable') == 'FAULT'
    graph.probe.destroy_publisher(rival)
    graph.advance(0.3)
    assert graph.command('enable') == 'ENABLED'


def test_a_velocity_that_outlives_its_sender_is_not_obeyed(graph, stick):
    stick.move(0.2, (0.1, 0.0))
    refused = graph.nodes['master'].motion.velocities.gate.refused
    before = refused[Refusal.SENDER]
    rival = graph.speak(JointState, SLAVE_VELOCITY, COMMAND)
    rival.publish(stick.message((2.0, 2.0)))
    graph.probe.destroy_publisher(rival)
    graph.advance(0.1)
    assert refused[Refusal.SENDER] > before
    assert graph.state == 'FAULT'
    assert max(max(desired.velocity) for desired in graph.desired) == pytest.approx(0.1)


@pytest.mark.parametrize('topic', [SLAVE_VELOCITY, TIP_VELOCITY])
def test_who_speaks_beside_a_master_that_plays_ends_the_session(topic):
    with run(overrides={'master': {'source': 'motion'}}) as graph:
        graph.advance(1.0)
        stick = Stick(graph, topic, clutch=None)
        assert graph.state == 'FAULT'
        assert "velocities are sent while the master's source is motion" in graph.cause
        moved = Moved(graph)
        stick.move(0.4, (0.4, 0.0) if topic == SLAVE_VELOCITY else ({}, {'x': 0.4}))
        assert moved.goals == []


def test_positions_are_obeyed_once_the_velocities_have_left(graph, stick):
    stick.move(0.2, (0.4, 0.0))
    stick.leave()
    graph.advance(0.3)
    graph.enable()
    assert graph.nodes['master'].count_publishers(SLAVE_COMMAND) == 0
    sender, clutch = Sender(graph, SLAVE_COMMAND), graph.speak(Joy, MASTER_CLUTCH, EVENT)
    moved, pose = Moved(graph), graph.nodes['master'].motion.where
    clutch.publish(Joy(buttons=[1]))
    graph.advance(TICK_S)
    for _ in range(ticks(0.2)):
        sender.send(pose)
        graph.advance(TICK_S)
    assert len(moved.goals) > 0.15 * TICK_RATE
    graph.probe.destroy_publisher(sender.publisher)
    graph.probe.destroy_publisher(clutch)
    stick.__init__(graph)


# ---- services


def ask(graph, service):
    client = graph.probe.create_client(Trigger, service)
    graph.wait(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    graph.wait(future.done)
    graph.probe.destroy_client(client)
    graph.advance(0.1)
    return future.result()


def test_stop_ends_the_session_and_the_slave_holds(graph, stick):
    stick.move(0.3, (0.4, 0.0))
    answer = ask(graph, SLAVE_STOP)
    assert (answer.success, answer.message) == (True, 'PAUSED')
    assert graph.state == 'PAUSED'
    moved = Moved(graph)
    stick.move(0.4, (0.4, 0.0))
    assert moved.goals == []
    assert moved.of_shafts < STILL
    graph.command('disable')
    answer = ask(graph, SLAVE_STOP)
    assert (answer.success, answer.message, graph.state) == (True, 'DISABLED', 'DISABLED')


def test_home_takes_the_motors_to_zero_or_says_why_not(graph, stick):
    stick.move(0.2, (0.5, 0.0))
    stick.clutch = 0
    stick.grip()
    answer = ask(graph, SLAVE_HOME)
    assert answer.success
    calibration = graph.nodes['calibration']
    while calibration.active:
        graph.advance(0.2)
    assert 'home reached' in calibration.orders.last
    assert graph.state == 'ENABLED'
    assert graph.diagnostics['master: velocities'][-1].level == OK
    graph.command('disable')
    answer = ask(graph, SLAVE_HOME)
    assert not answer.success
    assert 'the slave has to be ENABLED' in answer.message

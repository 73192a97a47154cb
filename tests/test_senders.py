"""Nothing moves for a second sender, nor when senders and nodes come and go.

In simulated time, so that every instant is the same in every run.
"""

import math
import time

import commanded_graph
import numpy as np
import pytest
from commanded_graph import BOUND, RIG, STILL, TICK_RATE, TICK_S, Handle, Moved, Sender, run, ticks
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState, Joy
from simulated_graph import PATIENCE_S
from std_msgs.msg import Header, String

from endoscope_core.safety import Refusal
from endoscope_nodes.names import (
    BOUNDS,
    CALIBRATION_RESULT,
    CORRECTION,
    JOINTS,
    MASTER_CLUTCH,
    MASTER_MEASURED,
    MOTION_SESSION,
    MOTOR_COMMAND,
    MOTORS,
    OPERATING_STATE,
    SLAVE_COMMAND,
    TIP_FORCE,
    TIP_FORCE_BOUNDS,
)
from endoscope_nodes.runtime.diagnostics import ERROR, OK, status
from endoscope_nodes.runtime.qos import COMMAND, EVENT, RESULT, SENSOR_OFFERED

LOW_REACH = {'low': -0.5, 'high': 0.5}
# pytest looks for the fixtures of a test in its own module.
foreign, master = commanded_graph.foreign, commanded_graph.master


def until(condition):
    """Wait for the middleware alone: no node is run."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(1e-3)


def leave_behind(graph, node, topic, message, qos):
    """Have a stranger send a message and go before a node is run that hears the topic."""
    readers = graph.probe.count_subscribers(topic)
    senders = next(s for s in node.subscriptions if s.topic_name.endswith(topic)).handle
    before = senders.get_publisher_count()
    stranger = Node('stranger', context=graph.runtime.context, namespace='endoscope')
    rival = stranger.create_publisher(type(message), topic, qos)
    until(
        lambda: (
            rival.get_subscription_count() == readers
            and senders.get_publisher_count() == before + 1
        )
    )
    rival.publish(message)
    stranger.destroy_node()
    until(lambda: senders.get_publisher_count() == before)


# ---- senders


def test_two_senders_of_a_motion_topic_are_a_fault_that_names_both():
    with run() as graph:
        graph.set('master', source='motion')
        graph.advance(2.0)
        moved = Moved(graph)
        for topic, names, value in (
            (SLAVE_COMMAND, JOINTS, 0.5),
            (CORRECTION, JOINTS, 2.0),
            (CORRECTION, JOINTS, math.nan),
            (MOTOR_COMMAND, MOTORS, 0.5),
        ):
            rival = Sender(graph, topic, names)
            for _ in range(ticks(0.2)):
                rival.send([value] * 2)
                graph.advance(TICK_S)
            assert graph.state == 'FAULT'
            assert topic in graph.cause
            assert '/endoscope/probe' in graph.cause
            assert graph.cause.count('/endoscope/') >= 2
            assert graph.command('enable') == 'FAULT'
            graph.probe.destroy_publisher(rival.publisher)
            graph.advance(0.3)
            assert graph.command('enable') == 'ENABLED'
            graph.advance(0.5)
        drives = [g for g in moved.goals if g.session]
        steps = np.abs(np.diff([s.position for s in moved.shafts], axis=0))
        assert len(drives) > 0.5 * TICK_RATE
        assert steps.max() < 1.3 * BOUND


@pytest.mark.parametrize(
    ('topic', 'names', 'reader'),
    [
        (MOTOR_COMMAND, MOTORS, 'motor_driver'),
        (SLAVE_COMMAND, JOINTS, 'compensator'),
        (SLAVE_COMMAND, JOINTS, 'controller'),
    ],
)
def test_a_command_that_outlives_its_sender_is_not_obeyed(foreign, master, topic, names, reader):
    """It waits for a node that is not run, and only the session's own sender is left by then."""
    master.move(0.2)
    node = foreign.nodes[reader]
    gates = {
        'motor_driver': lambda: node.motion.gate,
        'compensator': lambda: node.stream.gate,
        'controller': lambda: node._gate,
    }
    gate = gates[reader]()
    # The motor driver judges what came in its next turn.
    foreign.advance(TICK_S)
    pose = node.motion.goal if reader == 'motor_driver' else master.angle
    obeyed, refused = gate.accepted, gate.refused[Refusal.SENDER]
    message = JointState(name=list(names), position=[x + 1e-3 for x in pose])
    message.header.frame_id = foreign.session
    message.header.stamp = Time(nanoseconds=foreign.clock.now_ns + 1_000_000).to_msg()
    leave_behind(foreign, node, topic, message, COMMAND)
    for _ in range(200):
        if gate.accepted > obeyed or gate.refused[Refusal.SENDER] > refused:
            break
        foreign.advance(0.005)
    assert gate.accepted == obeyed
    assert gate.refused[Refusal.SENDER] > refused
    foreign.advance(0.1)
    assert foreign.state == 'FAULT'
    assert topic in foreign.cause


def test_a_heartbeat_that_outlives_its_sender_opens_nothing(foreign, master):
    """A rival of the supervisor has come and gone while the motor driver was not run."""
    master.move(0.2)
    node = foreign.nodes['motor_driver']
    leave_behind(foreign, node, MOTION_SESSION, Header(frame_id='session-99'), EVENT)
    entered = set()
    for _ in range(40):
        foreign.advance(0.005)
        entered.add(node._session.name)
    assert 'session-99' not in entered
    assert foreign.state == 'FAULT'
    assert MOTION_SESSION in foreign.cause


def test_a_clutch_that_outlives_its_sender_is_not_held_before_it_is_let_go_of(foreign, master):
    master.move(0.04)
    master.hold(0)
    clutches = [foreign.nodes[name]._clutch for name in ('compensator', 'master')]
    foreign.advance(0.1)
    leave_behind(foreign, foreign.nodes['compensator'], MASTER_CLUTCH, Joy(buttons=[1]), EVENT)
    held = []
    for _ in range(40):
        foreign.advance(0.005)
        held += [clutch.held for clutch in clutches]
    assert not any(held)
    assert foreign.state == 'FAULT'
    assert MASTER_CLUTCH in foreign.cause
    foreign.enable()
    master.hold(1)
    assert not any(clutch.held for clutch in clutches)
    master.hold(0)
    master.hold(1)
    assert all(clutch.held for clutch in clutches)


def test_a_handle_that_outlives_its_sender_is_not_followed(foreign):
    foreign.command('disable')
    foreign.enable()
    handle = Handle(foreign)
    handle.move(0.2, clutch=False)
    master = foreign.nodes['master']
    taken = []
    take = master.motion.handle.take
    master.motion.handle.take = lambda *sample: (taken.append(sample[1]), take(*sample))[1]
    message = JointState(name=list(JOINTS), position=[0.9, 0.9])
    message.header.stamp = Time(nanoseconds=foreign.clock.now_ns + 1_000_000).to_msg()
    leave_behind(foreign, master, MASTER_MEASURED, message, SENSOR_OFFERED)
    handle.move(0.1, clutch=False)
    del master.motion.handle.take
    foreign.probe.destroy_publisher(handle.publisher)
    foreign.probe.destroy_publisher(handle.clutch_publisher)
    assert taken
    assert (0.9, 0.9) not in taken
    assert foreign.state == 'FAULT'
    assert MASTER_MEASURED in foreign.cause


@pytest.mark.parametrize('reader', ['compensator', 'master'])
def test_a_result_that_outlives_its_sender_is_not_taken(reader):
    """Of the very session in which the slave is being calibrated."""
    with run() as graph:
        assert graph.call_calibration().success
        graph.advance(0.5)
        compensator, master = graph.nodes['compensator'], graph.nodes['master']
        assert compensator._calibrated_in == graph.session
        ranges = {f'reach.{joint}.{end}': x for joint in JOINTS for end, x in LOW_REACH.items()}
        result = DiagnosticArray()
        result.header.frame_id = graph.session
        result.status = [
            status('calibration: hysteresis class', OK, '', {'class_deg': 100} | ranges)
        ]
        leave_behind(graph, graph.nodes[reader], CALIBRATION_RESULT, result, RESULT)
        graph.advance(0.5)
        taken = {
            'compensator': compensator.law.pending or compensator.law.findings,
            'master': master.motion.ranges,
        }
        assert not taken[reader]
        assert graph.state == 'FAULT'
        assert CALIBRATION_RESULT in graph.cause


def test_a_rival_of_the_supervisor_moves_nothing():
    with run(overrides={'master': {'source': 'motion'}}) as graph:
        graph.command('disable')
        graph.advance(0.5)
        moved = Moved(graph)
        states = graph.speak(String, OPERATING_STATE, RESULT)
        sessions = graph.speak(Header, MOTION_SESSION, EVENT)
        for k in range(300):
            states.publish(String(data='ENABLED'))
            if k > 150:
                sessions.publish(Header(frame_id='session-99'))
            graph.advance(0.005)
        assert moved.goals == []
        assert moved.of_shafts < STILL
        causes = '; '.join(graph.nodes['supervisor'].machine.present_causes.values())
        assert '/endoscope/probe and /endoscope/supervisor' in causes


def test_health_of_another_rig_is_not_ours():
    """Neither does its error stop us, nor does its good health end our own trouble."""
    with run() as graph:
        publisher = graph.speak(DiagnosticArray, '/diagnostics', EVENT)

        def tell(name, level):
            publisher.publish(DiagnosticArray(status=[status(name, level, 'broken', {})]))
            graph.advance(0.1)

        for others in ('/arm1/ghost: motion session', 'ghost: motion session'):
            tell(others, ERROR)
            assert graph.state == 'ENABLED'
            tell('/endoscope/ghost: motion session', ERROR)
            assert graph.state == 'FAULT'
            tell(others, OK)
            assert graph.command('enable') == 'FAULT'
            tell('/endoscope/ghost: motion session', OK)
            assert graph.command('enable') == 'ENABLED'


def test_a_session_that_ends_before_the_nodes_next_turn_is_left():
    with run() as graph:
        session = graph.nodes['calibration']._session
        left = []
        session._on_leave = lambda: left.append(session.name)
        for heartbeat in ('session-of-a-moment', ''):
            session._hear(Header(frame_id=heartbeat))
        assert left == ['']


FORCES = ([0.5, -0.5, 0.4, -0.6, 0.6, -0.4, 1.0], [-9.0, 9.0, -9.1, 8.9, -8.9, 9.1, 1.0])


def test_a_stranger_who_says_what_the_tip_touches_moves_nothing_and_only_slows(foreign, master):
    """Alone, for the node that works it out does not run; nobody hears the force without bounds."""
    stranger = Sender(foreign, TIP_FORCE_BOUNDS, BOUNDS, SENSOR_OFFERED)
    forces = foreign.speak(WrenchStamped, TIP_FORCE, SENSOR_OFFERED)
    guard = foreign.nodes['compensator'].stream.contact
    master.move(0.2)
    master.hold(0)
    foreign.advance(0.3)
    moved = Moved(foreign)
    for k in range(60):
        values = FORCES[k % 2] if k < 40 else [math.nan] * len(BOUNDS)
        stranger.send([], effort=values)
        forces.publish(WrenchStamped())
        foreign.advance(0.01)
    assert moved.goals == []
    assert moved.of_shafts < STILL
    master.start, master.way = foreign.nodes['compensator']._pose.bending(), 0.0
    asked = []
    stranger.send([], effort=FORCES[0])
    foreign.advance(0.05)
    assert guard.joints == JOINTS
    master.hold(1)
    moved.clear()
    for k in range(30):
        stranger.send([], effort=FORCES[k % 2])
        master.move(0.02)
        asked.append(master.angle)
    way = np.ptp([s.position for s in moved.goals], axis=0) / RIG.joints.gear
    assert way.max() <= np.ptp(asked, axis=0).max() + STILL
    assert moved.largest_step < BOUND
    assert foreign.state == 'ENABLED'
    for publisher in (stranger.publisher, forces):
        foreign.probe.destroy_publisher(publisher)


def test_two_who_say_what_the_tip_touches_are_a_fault():
    with run() as graph:
        stranger = Sender(graph, TIP_FORCE_BOUNDS, BOUNDS, SENSOR_OFFERED)
        stranger.send([], effort=FORCES[0])
        graph.advance(0.1)
        assert graph.state == 'ENABLED'
        message = JointState(name=list(BOUNDS), effort=FORCES[1])
        compensator = graph.nodes['compensator']
        leave_behind(graph, compensator, TIP_FORCE_BOUNDS, message, SENSOR_OFFERED)
        felt = compensator.stream.contact.in_words()
        graph.advance(0.1)
        assert compensator.stream.contact.in_words() == felt
        assert graph.state == 'FAULT'
        assert TIP_FORCE_BOUNDS in graph.cause


# ---- nodes that vanish and come back


def test_a_node_started_anew_needs_another_enable():
    with run(overrides={'master': {'source': 'motion'}}) as graph:
        for name in ('compensator', 'master', 'controller'):
            graph.advance(1.5)
            graph.kill(name)
            graph.advance(0.02)
            graph.start(name)
            graph.advance(0.3)
            assert graph.state == 'FAULT', name
            moved = Moved(graph)
            graph.advance(0.5)
            assert moved.goals == [], name
            assert moved.of_shafts < STILL, name
            assert graph.command('enable') == 'ENABLED'
            graph.advance(0.6)
            assert len(moved.goals) > 0.5 * TICK_RATE, name
            assert moved.largest_step < BOUND, name


def test_a_calibration_node_started_anew_is_believed_after_another_enable():
    """And its latched result is not taken by a compensator that is started anew after it."""
    with run(overrides={'calibration': {'motion': 'brief'}}) as graph:
        assert graph.call_calibration().success
        graph.advance(0.5)
        graph.kill('calibration')
        graph.advance(0.02)
        graph.start('calibration')
        graph.advance(0.3)
        assert graph.state == 'FAULT'
        graph.enable()
        graph.calibrate()
        graph.advance(0.1)
        assert graph.state == 'ENABLED'
        assert graph.nodes['compensator'].law.findings is not None
        assert graph.nodes['master'].motion.ranges
        graph.kill('compensator')
        graph.advance(0.02)
        graph.start('compensator')
        graph.advance(0.3)
        graph.enable()
        graph.advance(0.5)
        assert graph.nodes['compensator'].law.findings is None

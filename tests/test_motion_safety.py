"""Nothing moves that was not asked to: states, sessions, senders and commands of the running graph.

In simulated time, so that every instant is the same in every run.
"""

import dataclasses
import math
import time
from types import SimpleNamespace

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState, Joy
from simulated_graph import PATIENCE_S, TICK_RATE, SimulatedGraph
from std_msgs.msg import Header, String

from endoscope_core.rig import load_rig
from endoscope_core.safety import Refusal
from endoscope_nodes.diagnostics import ERROR, OK, WARN, status
from endoscope_nodes.names import (
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
)
from endoscope_nodes.qos import COMMAND, EVENT, RESULT, SENSOR_OFFERED

RIG = load_rig()
# What a goal of the shafts may change in a tick: the shaper's speed, and rounding.
TICK_S = 1.0 / TICK_RATE
BOUND = RIG.motors.speed * TICK_S * 1.001
STILL = 0.003
LOW_REACH = {'low': -0.5, 'high': 0.5}


class Sender:
    """Publishes JointStates from the test, as somebody else's program does."""

    def __init__(self, graph, topic, names=JOINTS, qos=COMMAND):
        self._graph = graph
        self._names = names
        self._publisher = graph.speak(JointState, topic, qos)

    def send(self, position, session=None, ahead_ns=0, **fields):
        message = JointState(name=list(self._names), position=list(position))
        stamp = self._graph.conductor.now_ns + ahead_ns
        message.header.stamp = Time(nanoseconds=stamp).to_msg()
        message.header.frame_id = self._graph.session if session is None else session
        for field, value in fields.items():
            setattr(message, field, value)
        self._publisher.publish(message)


class ForeignConsole(Sender):
    """Writes ``slave/servo_jp`` while the console's source is ``none``."""

    def __init__(self, graph):
        super().__init__(graph, SLAVE_COMMAND)
        self._clutch = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        self._sent = 0
        self.clutch = 1
        self._start = graph.nodes['compensator']._pose.bending()
        self._way = 0.0
        self._towards = -1.0 if self._start[0] > 0.0 else 1.0

    @property
    def angle(self):
        """What it asks for, rad, from where the slave is at first."""
        return [start + self._way for start in self._start]

    def tick(self, position=None, **changes):
        if self._sent % 50 == 0 and self.clutch is not None:
            self._clutch.publish(Joy(buttons=[self.clutch]))
            self._graph.advance(TICK_S)
        self._sent += 1
        self.send(self.angle if position is None else position, **changes)
        self._graph.advance(TICK_S)

    def hold(self, clutch):
        self.clutch = clutch
        self._clutch.publish(Joy(buttons=[clutch]))
        self._graph.advance(TICK_S)

    def move(self, ticks, speed=0.5):
        for _ in range(ticks):
            self._way += TICK_S * speed * self._towards
            self.tick(velocity=[speed * self._towards] * 2)


class Handle(Sender):
    """A handle with a clutch at 10 Hz."""

    def __init__(self, graph, rate=200):
        super().__init__(graph, MASTER_MEASURED, qos=SENSOR_OFFERED)
        self._clutch = graph.speak(Joy, MASTER_CLUTCH, EVENT)
        self.rate = rate
        self._count = 0
        self.angle = np.array([0.5, -0.3])

    def move(self, seconds, speed=(0.0, 0.0), clutch=True, alive=True):
        for _ in range(round(seconds * self.rate)):
            self.angle = self.angle + np.array(speed) / self.rate
            if alive:
                self.send(self.angle, session='')
            if alive and self._count % (self.rate // 10) == 0:
                self._clutch.publish(Joy(buttons=[int(clutch)]))
            self._count += 1
            self._graph.advance(1.0 / self.rate)


class Moved:
    """What goals and shafts have done since."""

    def __init__(self, graph):
        self.goals = graph.listen(MOTOR_COMMAND, MOTORS)
        self.shafts = graph.listen('motor/measured_js', MOTORS)
        self._bending = graph.listen('simulation/bending')

    def clear(self):
        for samples in (self.goals, self.shafts, self._bending):
            samples.clear()

    @property
    def of_shafts(self):
        return float(np.ptp([s.position for s in self.shafts], axis=0).max())

    @property
    def of_tip(self):
        return float(np.ptp([s.position for s in self._bending], axis=0).max())

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
    graph = SimulatedGraph(**arguments)
    graph.enable()
    return graph


# ---- states


def test_pause_holds_and_resume_goes_on_without_a_jump():
    with run() as graph:
        graph.set('console', source='motion')
        graph.advance(2.0)
        moved = Moved(graph)
        first = graph.session
        assert graph.command('pause') == 'PAUSED'
        graph.advance(0.3)
        moved.clear()
        graph.advance(1.0)
        assert graph.session == ''
        assert moved.goals == []
        assert moved.of_shafts < STILL
        assert graph.command('resume') == 'ENABLED'
        graph.advance(1.5)
        assert graph.session not in ('', first)
        assert len(moved.goals) > 1.4 * TICK_RATE
        assert moved.largest_step < BOUND


def test_over_tension_is_a_fault_that_latches():
    rig = dataclasses.replace(RIG, tension=dataclasses.replace(RIG.tension, ceiling=8.0))
    with run(rig=rig) as graph:
        graph.set('console', source='motion')
        graph.advance(2.8)
        assert graph.state == 'FAULT'
        assert 'over the ceiling' in graph.cause
        moved = Moved(graph)
        graph.advance(1.0)
        # Friction lets the tension of a motor that stops fall; the fault stays.
        assert graph.state == 'FAULT'
        assert moved.goals == []
        assert graph.diagnostics['supervisor: operating state'][-1].level == b'\x02'


def test_a_slave_whose_wires_are_too_tight_at_rest_is_not_enabled():
    rig = dataclasses.replace(RIG, tension=dataclasses.replace(RIG.tension, ceiling=4.5))
    with SimulatedGraph(rig=rig) as graph:
        graph.advance(0.2)
        assert graph.command('enable') != 'ENABLED'
        causes = '; '.join(graph.nodes['supervisor'].machine.present_causes.values())
        assert 'over the ceiling of 4.5 N' in causes


def test_load_cells_unplugged_are_a_fault_that_torque_off_leaves_at_any_time():
    with run(overrides={'conductor': {'wait_for': ['motor/measured_js']}}) as graph:
        graph.set('load_cells', connected=False)
        graph.advance(0.5)
        assert graph.state == 'FAULT'
        assert graph.command('enable') == 'FAULT'
        assert graph.command('disable') == 'DISABLED'
        assert not graph.nodes['motor_driver']._slave._torque
        assert graph.command('enable') == 'DISABLED'
        graph.set('load_cells', connected=True)
        graph.advance(0.5)
        assert graph.state == 'DISABLED'
        assert graph.command('enable') == 'ENABLED'


def test_enabling_waits_for_the_slave():
    with SimulatedGraph() as graph:
        assert graph.command('enable') == 'DISABLED'
        graph.advance(0.2)
        assert graph.command('enable') == 'ENABLED'


def test_state_commands_out_of_place_change_nothing():
    with SimulatedGraph() as graph:
        graph.advance(0.1)
        assert graph.command('resume') == 'DISABLED'
        assert graph.command('fly') == 'DISABLED'
        graph.advance(1.1)
        assert 'fly' in graph.reported('supervisor: operating state')['last refusal']


# ---- commands of an outside program


@pytest.fixture(scope='module')
def foreign():
    """A graph whose console is silent, for tests that leave it as they found it."""
    with run() as graph:
        yield graph


@pytest.fixture
def console(foreign):
    """The foreign console, in a session of its own and at the pose of then."""
    foreign.command('disable')
    foreign.advance(0.5)
    foreign.enable()
    console = ForeignConsole(foreign)
    yield console
    foreign.probe.destroy_publisher(console._publisher)
    foreign.probe.destroy_publisher(console._clutch)
    foreign.command('disable')
    foreign.advance(0.1)


@pytest.mark.parametrize(
    ('changes', 'reason'),
    [
        ({'position': [math.nan, 0.0]}, 'not finite'),
        ({'velocity': [0.0, math.inf]}, 'not finite'),
        ({'ahead_ns': -300_000_000}, 'stamp not increasing'),
        ({'ahead_ns': 10_000_000_000}, 'stamped in the future'),
        ({'ahead_ns': 1_000_000_000 * 86_400 * 365}, 'stamped in the future'),
        ({'name': ['bend_x', 'elbow']}, 'malformed'),
        ({'name': ['bend_x'], 'position': [0.0]}, 'malformed'),
        ({'position': [0.0]}, 'malformed'),
        ({'name': ['bend_x', 'bend_y'], 'effort': [0.0] * 1_200_000}, 'malformed'),
        ({'position': [3.0, 0.0]}, 'out of range'),
        ({'position': [0.8, 0.0]}, 'too fast'),
        ({'session': ''}, 'not of this motion session'),
        ({'session': 'session-1'}, 'not of this motion session'),
    ],
)
def test_a_bad_command_is_refused_counted_and_changes_nothing(foreign, console, changes, reason):
    console.move(200)
    moved = Moved(foreign)
    before = foreign.nodes['compensator'].gate.refused[reason]
    console.tick(**changes)
    assert moved.goals == []
    console.move(100)
    foreign.advance(0.05)
    assert foreign.state == 'ENABLED'
    assert foreign.nodes['compensator'].gate.refused[reason] == before + 1
    assert len(moved.goals) == 100
    assert moved.largest_step < TICK_S


def test_the_order_of_the_joints_does_not_matter(foreign, console):
    console.move(200)
    moved = Moved(foreign)
    console.move(20)
    x, y = console.angle
    # Onwards: at a reversal the feed-forward crosses the backlash.
    console.tick([y + console._towards * TICK_S, x], name=['bend_y', 'bend_x'])
    steps = np.subtract(moved.goals[-1].position, moved.goals[-2].position)
    assert steps[1] * console._towards > steps[0] * console._towards


def test_a_step_is_refused_and_ends_the_session(foreign, console):
    console.move(200)
    moved = Moved(foreign)
    for _ in range(300):
        console.tick([1.4 * console._towards] * 2)
    assert foreign.state == 'FAULT'
    assert foreign.nodes['compensator'].gate.refused['too fast']
    assert 'slave/servo_jp ended while the clutch was held (too far' in foreign.cause
    assert moved.largest_step < BOUND
    assert moved.of_shafts < 0.05


def test_a_first_command_far_from_the_measured_pose_moves_nothing(foreign, console):
    moved = Moved(foreign)
    console._way = 0.3
    for _ in range(300):
        console.tick()
    assert moved.goals == []
    assert moved.of_shafts < STILL


def test_stamps_that_run_ahead_stretch_no_allowance(foreign, console):
    """The allowance of speed is spent once, not by every message anew."""
    moved = Moved(foreign)
    speed = RIG.joints.speed
    for k in range(200):
        console._way = console._towards * min(1.0, abs(console._way) + 0.02 * speed)
        console.tick(ahead_ns=k * 20_000_000)
    assert moved.largest_step < BOUND
    assert foreign.nodes['compensator'].gate.refused['too fast']


def test_enabling_anew_clears_what_a_stamp_from_the_future_left(foreign, console):
    console.tick(ahead_ns=10_000_000_000)
    console.move(50)
    assert foreign.state == 'ENABLED'
    foreign.command('disable')
    foreign.advance(0.2)
    foreign.enable()
    corrections = foreign.listen(CORRECTION)
    console._start, console._way = foreign.nodes['compensator']._pose.bending(), 0.0
    console.move(600)
    assert len(corrections) > 1.1 * TICK_RATE
    assert foreign.diagnostics['controller: feedback'][-1].message == 'in the loop'


def test_a_velocity_that_belies_the_positions_moves_nothing(foreign, console):
    console.move(100)
    for _ in range(300):
        console.tick(velocity=[0.0, 0.0])
    moved = Moved(foreign)
    for k in range(500):
        console.tick(velocity=[0.5 if k % 50 == 0 else 0.0] * 2)
    assert moved.largest_step < TICK_S
    assert moved.of_tip < 0.02


@pytest.mark.parametrize('clutch', [0, None], ids=['released', 'never heard of'])
def test_nothing_moves_unless_the_clutch_is_held(foreign, console, clutch):
    foreign.advance(0.4)
    console.clutch = clutch
    moved = Moved(foreign)
    before = foreign.nodes['compensator'].gate.refused['clutch not held']
    console.move(100)
    assert moved.goals == []
    assert foreign.nodes['compensator'].gate.refused['clutch not held'] == before + 100


def test_a_clutch_that_falls_silent_is_released(foreign, console):
    moved = Moved(foreign)
    console.move(20)
    console.clutch = None
    console.move(600)
    assert 0.34 * TICK_RATE <= len(moved.goals) <= 0.38 * TICK_RATE
    assert foreign.state == 'ENABLED'


def test_commands_that_end_with_the_clutch_held_end_the_session(foreign, console):
    console.move(300)
    moved = Moved(foreign)
    foreign.advance(0.3)
    assert foreign.state == 'FAULT'
    assert 'slave/servo_jp ended while the clutch was held' in foreign.cause
    moved.clear()
    foreign.advance(0.5)
    assert moved.of_shafts < STILL


def test_nothing_moves_unless_enabled(foreign, console):
    assert foreign.command('disable') == 'DISABLED'
    moved = Moved(foreign)
    console.move(100)
    assert moved.goals == []
    assert moved.of_shafts < STILL


# ---- senders


def test_two_senders_of_a_motion_topic_are_a_fault_that_names_both():
    with run() as graph:
        graph.set('console', source='motion')
        graph.advance(2.0)
        moved = Moved(graph)
        for topic, names, value in (
            (SLAVE_COMMAND, JOINTS, 0.5),
            (CORRECTION, JOINTS, 2.0),
            (CORRECTION, JOINTS, 1e9),
            (CORRECTION, JOINTS, math.nan),
            (MOTOR_COMMAND, MOTORS, 0.5),
        ):
            rival = Sender(graph, topic, names)
            for _ in range(100):
                rival.send([value] * 2)
                graph.advance(TICK_S)
            assert graph.state == 'FAULT'
            assert topic in graph.cause
            assert '/endoscope/probe' in graph.cause
            assert graph.cause.count('/endoscope/') >= 2
            assert graph.command('enable') == 'FAULT'
            graph.probe.destroy_publisher(rival._publisher)
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
def test_a_command_that_outlives_its_sender_is_not_obeyed(foreign, console, topic, names, reader):
    """It waits for a node that is not run, and only the session's own sender is left by then."""
    console.move(100)
    node = foreign.nodes[reader]
    gates = {
        'motor_driver': lambda: node.motion.gate,
        'compensator': lambda: node.gate,
        'controller': lambda: node._gate,
    }
    gate = gates[reader]()
    pose = node.motion.goal if reader == 'motor_driver' else console.angle
    obeyed, refused = gate.accepted, gate.refused[Refusal.SENDER]
    message = JointState(name=list(names), position=[x + 1e-3 for x in pose])
    message.header.frame_id = foreign.session
    message.header.stamp = Time(nanoseconds=foreign.conductor.now_ns + 1_000_000).to_msg()
    leave_behind(foreign, node, topic, message, COMMAND)
    foreign.wait(lambda: gate.accepted > obeyed or gate.refused[Refusal.SENDER] > refused)
    assert gate.accepted == obeyed
    foreign.advance(0.1)
    assert foreign.state == 'FAULT'
    assert topic in foreign.cause


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


def test_a_heartbeat_that_outlives_its_sender_opens_nothing(foreign, console):
    """A rival of the supervisor has come and gone while the motor driver was not run."""
    console.move(100)
    node = foreign.nodes['motor_driver']
    leave_behind(foreign, node, MOTION_SESSION, Header(frame_id='session-99'), EVENT)
    entered = set()
    for _ in range(40):
        foreign.advance(0.005)
        entered.add(node._session.name)
    assert 'session-99' not in entered
    assert foreign.state == 'FAULT'
    assert MOTION_SESSION in foreign.cause


def test_a_clutch_that_outlives_its_sender_is_not_held_before_it_is_let_go_of(foreign, console):
    console.move(20)
    console.hold(0)
    clutches = [foreign.nodes[name]._clutch for name in ('compensator', 'console')]
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
    console.hold(1)
    assert not any(clutch.held for clutch in clutches)
    console.hold(0)
    console.hold(1)
    assert all(clutch.held for clutch in clutches)


def test_a_handle_that_outlives_its_sender_is_not_followed(foreign):
    foreign.command('disable')
    foreign.enable()
    handle = Handle(foreign)
    handle.move(0.2, clutch=False)
    console = foreign.nodes['console']
    taken = []
    take = console._handle.take
    console._handle.take = lambda *sample: (taken.append(sample[1]), take(*sample))[1]
    message = JointState(name=list(JOINTS), position=[0.9, 0.9])
    message.header.stamp = Time(nanoseconds=foreign.conductor.now_ns + 1_000_000).to_msg()
    leave_behind(foreign, console, MASTER_MEASURED, message, SENSOR_OFFERED)
    handle.move(0.1, clutch=False)
    del console._handle.take
    foreign.probe.destroy_publisher(handle._publisher)
    foreign.probe.destroy_publisher(handle._clutch)
    assert taken
    assert (0.9, 0.9) not in taken
    assert foreign.state == 'FAULT'
    assert MASTER_MEASURED in foreign.cause


@pytest.mark.parametrize('reader', ['compensator', 'console'])
def test_a_result_that_outlives_its_sender_is_not_taken(reader):
    """Of the very session in which the slave is being calibrated."""
    with run() as graph:
        assert graph.call_calibration().success
        graph.advance(0.5)
        compensator, console = graph.nodes['compensator'], graph.nodes['console']
        assert compensator._calibrated_in == graph.session
        reaches = {f'reach.{joint}.{end}': x for joint in JOINTS for end, x in LOW_REACH.items()}
        result = DiagnosticArray()
        result.header.frame_id = graph.session
        result.status = [
            status('calibration: hysteresis class', OK, '', {'class_deg': 100} | reaches)
        ]
        leave_behind(graph, graph.nodes[reader], CALIBRATION_RESULT, result, RESULT)
        graph.advance(0.5)
        taken = {'compensator': compensator._found, 'console': console._reaches}
        assert not taken[reader]
        assert graph.state == 'FAULT'
        assert CALIBRATION_RESULT in graph.cause


def until(condition):
    """Wait for the middleware alone: no node is run."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(1e-3)


@pytest.mark.parametrize('session', ['', 'session-99'])
def test_a_rival_of_the_supervisor_moves_nothing(session):
    with run() as graph:
        graph.set('console', source='motion')
        graph.command('disable')
        graph.advance(0.5)
        moved = Moved(graph)
        states = graph.speak(String, OPERATING_STATE, RESULT)
        sessions = graph.speak(Header, MOTION_SESSION, EVENT)
        for _ in range(300):
            states.publish(String(data='ENABLED'))
            if session:
                sessions.publish(Header(frame_id=session))
            graph.advance(0.005)
        assert moved.goals == []
        assert moved.of_shafts < STILL
        causes = '; '.join(graph.nodes['supervisor'].machine.present_causes.values())
        assert '/endoscope/probe and /endoscope/supervisor' in causes


def test_a_result_of_somebody_else_changes_nothing():
    with run() as graph:
        graph.set('console', source='motion')
        graph.advance(2.0)
        result = DiagnosticArray()
        result.header.frame_id = graph.session
        result.status = [status('calibration: hysteresis class', OK, '', {'class_deg': 100})]
        publisher = graph.speak(DiagnosticArray, CALIBRATION_RESULT, RESULT)
        publisher.publish(result)
        graph.advance(0.5)
        assert graph.nodes['compensator'].findings is None
        assert graph.state == 'FAULT'
        assert CALIBRATION_RESULT in graph.cause


@pytest.mark.parametrize('prefix', ['/arm1/', ''], ids=['another rig', 'no namespace'])
def test_health_of_another_rig_is_not_ours(prefix):
    """Neither does its error stop us, nor does its good health end our own trouble."""
    others = f'{prefix}ghost: motion session'
    with run() as graph:
        publisher = graph.speak(DiagnosticArray, '/diagnostics', EVENT)

        def tell(name, level):
            publisher.publish(DiagnosticArray(status=[status(name, level, 'broken', {})]))
            graph.advance(0.1)

        tell(others, ERROR)
        assert graph.state == 'ENABLED'
        tell('/endoscope/ghost: motion session', ERROR)
        assert graph.state == 'FAULT'
        tell(others, OK)
        assert graph.command('enable') == 'FAULT'
        tell('/endoscope/ghost: motion session', OK)
        assert graph.command('enable') == 'ENABLED'


# ---- nodes that vanish and come back


def test_a_dead_supervisor_stops_the_motion_within_a_fifth_of_a_second():
    with run() as graph:
        graph.set('console', source='motion')
        graph.advance(2.0)
        moved = Moved(graph)
        graph.kill('supervisor')
        graph.advance(1.0)
        assert len(moved.goals) <= 200
        moved.clear()
        graph.advance(1.0)
        assert moved.of_shafts < STILL
        graph.start('supervisor')
        graph.advance(0.5)
        assert graph.state == 'DISABLED'
        assert moved.goals == []
        graph.enable()
        graph.advance(1.0)
        assert len(moved.goals) > 0.9 * TICK_RATE
        assert moved.largest_step < BOUND


@pytest.mark.parametrize('name', ['compensator', 'console', 'controller'])
def test_a_node_started_anew_needs_another_enable(name):
    with run(overrides={'console': {'source': 'motion'}}) as graph:
        graph.advance(2.5)
        graph.kill(name)
        graph.advance(0.02)
        graph.start(name)
        graph.advance(0.3)
        assert graph.state == 'FAULT'
        moved = Moved(graph)
        graph.advance(1.0)
        assert moved.goals == []
        assert moved.of_shafts < STILL
        assert graph.command('enable') == 'ENABLED'
        graph.advance(1.0)
        assert len(moved.goals) > 0.9 * TICK_RATE
        assert moved.largest_step < BOUND


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
        assert graph.nodes['compensator'].findings is not None
        assert graph.nodes['console']._reaches
        graph.kill('compensator')
        graph.advance(0.02)
        graph.start('compensator')
        graph.advance(0.3)
        graph.enable()
        graph.advance(0.5)
        assert graph.nodes['compensator'].findings is None


def test_a_tracker_that_comes_back_moves_nothing():
    with run(overrides={'calibration': {'motion': 'brief'}}) as graph:
        graph.calibrate()
        handle = Handle(graph)
        graph.set('console', source='master')
        handle.move(2.0, (0.4, 0.3))
        handle.move(0.5)
        moved = Moved(graph)
        graph.kill('em_tracker')
        handle.move(1.5)
        graph.start('em_tracker')
        handle.move(2.0)
        assert graph.state == 'ENABLED'
        assert moved.largest_step < BOUND
        assert moved.of_tip < 0.05


# ---- the handle


def test_engaging_re_references_without_a_jump():
    with run(overrides={'console': {'source': 'master', 'scale': 0.5}}) as graph:
        commands = graph.listen(SLAVE_COMMAND)
        handle = Handle(graph)
        handle.move(0.4, (0.5, 0.0))
        assert commands[0].position == pytest.approx((0.0, 0.0), abs=0.02)
        assert 0.05 < commands[-1].position[0] < 0.12
        handle.move(0.5, (2.0, 2.0), clutch=False)
        released = len(commands)
        handle.move(0.2, (2.0, 2.0), clutch=False)
        assert len(commands) == released
        pose = graph.nodes['console']._pose.bending()
        handle.move(0.4, (0.0, 0.5))
        assert commands[released].position == pytest.approx(pose, abs=0.02)
        steps = np.abs(np.diff([c.position for c in commands[released:]], axis=0))
        assert steps.max() < 0.006


def test_a_clutch_held_through_an_interrupted_calibration_moves_nothing():
    """The console engages at the measured pose, not at its own last command."""
    with run(overrides={'console': {'source': 'master'}}) as graph:
        handle = Handle(graph)
        handle.move(0.6, (0.7, 0.7))
        assert graph.call_calibration().success
        handle.move(2.5)
        assert graph.command('pause') == 'PAUSED'
        handle.move(0.5)
        moved = Moved(graph)
        assert graph.command('resume') == 'ENABLED'
        handle.move(1.5)
        assert len(moved.goals) > TICK_RATE
        assert moved.of_tip < 0.02
        assert moved.largest_step < 0.002


@pytest.mark.parametrize('rate', [50, 100, 250])
def test_a_handle_of_any_rate_is_followed_smoothly(rate):
    with run(overrides={'console': {'source': 'master'}}) as graph:
        commands = graph.listen(SLAVE_COMMAND)
        moved = Moved(graph)
        handle = Handle(graph, rate)
        handle.move(0.5)
        handle.move(1.5, (0.5, 0.0))
        positions = np.array([c.position[0] for c in commands])
        speeds = np.abs(np.diff(positions[-TICK_RATE:])) / TICK_S
        assert speeds.max() < 0.75
        assert speeds.min() > 0.25
        assert moved.largest_step < BOUND
        assert not any(graph.nodes['console']._handle.refused.values())


def test_a_handle_at_rest_with_a_count_of_noise_leaves_the_tip_at_rest():
    noise = np.random.default_rng(4)
    with run(overrides={'calibration': {'motion': 'brief'}}) as graph:
        graph.calibrate()
        graph.set('console', source='master')
        handle, moved = Handle(graph), Moved(graph)
        for rate in (50, TICK_RATE):
            handle.rate = rate
            handle.move(1.0, (0.3, 0.3))
            handle.move(0.5)
            moved.clear()
            rest = handle.angle
            for _ in range(rate):
                handle.angle = rest + RIG.handle.resolution * noise.integers(-1, 2, 2)
                handle.move(1.0 / rate)
            assert len(moved.goals) > 0.9 * TICK_RATE
            assert moved.of_tip < 0.02


def test_unusable_handle_messages_are_counted_and_said():
    with run(overrides={'console': {'source': 'master'}}) as graph:
        handle = Handle(graph)
        handle.move(0.2)
        handle.send([math.nan, 0.0], session='')
        handle.send([0.0, 0.0], session='', name=['elbow', 'wrist'])
        graph.advance(1.1)
        told = [s.message for s in graph.diagnostics['console: commands']]
        assert any('elbow' in message or 'not finite' in message for message in told)
        values = graph.reported('console: commands')
        assert values['handle refused: not finite'] == values['handle refused: malformed'] == '1'


@pytest.mark.parametrize('source', ['none', 'motion'])
def test_a_handle_that_nothing_follows_is_said_with_what_to_do(source):
    with run(overrides={'console': {'source': source}}) as graph:
        console, said = graph.nodes['console'], []
        # While a motion is played the handle's clutch is a second one: an error of its own.
        console.get_logger = lambda: SimpleNamespace(warning=said.append, error=lambda _: None)
        handle = Handle(graph)
        handle.move(1.1, clutch=False)
        assert not said
        handle.move(3.0, (0.05, 0.0), clutch=False)
        advice = 'endoscope operate set console.source master'
        told = graph.diagnostics['console: commands'][-1]
        assert told.level == WARN
        assert told.message == (
            f"the handle moves and nothing follows it: the console's source is {source}; {advice}"
        )
        assert said == [told.message]
        graph.set('console', source='master')
        handle.move(2.1, (0.05, 0.0), clutch=False)
        assert advice not in graph.diagnostics['console: commands'][-1].message
        assert len(said) == 1


def test_a_clutch_that_holds_nothing_is_said_unless_a_program_commands_the_slave():
    with run() as graph:
        handle = Handle(graph)
        handle.move(1.1)
        assert 'has its clutch held' in graph.diagnostics['console: commands'][-1].message
        graph.speak(JointState, SLAVE_COMMAND, COMMAND)
        handle.move(1.1)
        assert graph.diagnostics['console: commands'][-1].level == OK


def test_a_handle_that_falls_silent_stands_and_is_taken_up_where_the_slave_is():
    with run(overrides={'console': {'source': 'master'}}) as graph:
        handle = Handle(graph)
        handle.move(1.0, (0.5, 0.5))
        moved = Moved(graph)
        clutch = handle._clutch
        for _ in range(10):
            clutch.publish(Joy(buttons=[1]))
            graph.advance(0.05)
        moved.clear()
        handle.angle = handle.angle + 0.7
        handle.move(0.5)
        assert graph.state == 'ENABLED'
        assert moved.of_shafts < 0.02

"""Nothing moves that was not asked to: states, commands and the handle of the running graph.

In simulated time, so that every instant is the same in every run.
"""

import dataclasses
import math
from types import SimpleNamespace

import commanded_graph
import numpy as np
import pytest
from commanded_graph import BOUND, RIG, STILL, TICK_RATE, TICK_S, Handle, Moved, run, ticks
from sensor_msgs.msg import JointState, Joy
from simulated_graph import SimulatedGraph

from endoscope_nodes.names import CORRECTION, MOTOR_MEASURED, MOTORS, SLAVE_COMMAND
from endoscope_nodes.runtime.diagnostics import OK, WARN
from endoscope_nodes.runtime.qos import COMMAND

# pytest looks for the fixtures of a test in its own module.
foreign, master = commanded_graph.foreign, commanded_graph.master


# ---- states


def test_pause_holds_and_resume_goes_on_without_a_jump():
    with run() as graph:
        graph.set('master', source='motion')
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
        graph.set('master', source='motion')
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
    with run(overrides={'simulation_clock': {'wait_for': ['motor/measured_js']}}) as graph:
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


# ---- commands of an outside program


BAD = (
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
)


def test_a_bad_command_is_refused_counted_and_changes_nothing(foreign, master):
    gate = foreign.nodes['compensator'].stream.gate
    moved = Moved(foreign)
    for changes, reason in BAD:
        # Not as far as the joints reach, all in all.
        master.move(0.1)
        foreign.advance(TICK_S)
        before, obeyed = gate.refused[reason], gate.accepted
        moved.clear()
        master.tick(**changes)
        assert moved.goals == [], changes
        assert (gate.refused[reason], gate.accepted) == (before + 1, obeyed), changes
        master.move(0.06)
        assert len(moved.goals) >= ticks(0.06) - 1, changes
        assert moved.largest_step < TICK_S, changes
    assert foreign.state == 'ENABLED'


def test_the_order_of_the_joints_does_not_matter(foreign, master):
    master.move(0.4)
    moved = Moved(foreign)
    master.move(0.04)
    x, y = master.angle
    # Onwards: at a reversal the feed-forward crosses the backlash.
    master.tick([y + master.towards * TICK_S, x], name=['bend_y', 'bend_x'])
    steps = np.subtract(moved.goals[-1].position, moved.goals[-2].position)
    assert steps[1] * master.towards > steps[0] * master.towards


def test_a_step_is_refused_and_ends_the_session(foreign, master):
    master.move(0.4)
    moved = Moved(foreign)
    for _ in range(ticks(0.6)):
        master.tick([1.4 * master.towards] * 2)
    assert foreign.state == 'FAULT'
    assert foreign.nodes['compensator'].stream.gate.refused['too fast']
    assert 'slave/servo_jp ended while the clutch was held (too far' in foreign.cause
    assert moved.largest_step < BOUND
    assert moved.of_shafts < 0.05


def test_enabling_anew_clears_what_a_stamp_from_the_future_left(foreign, master):
    master.tick(ahead_ns=10_000_000_000)
    master.move(0.1)
    assert foreign.state == 'ENABLED'
    foreign.command('disable')
    foreign.advance(0.2)
    foreign.enable()
    corrections = foreign.listen(CORRECTION)
    master.start, master.way = foreign.nodes['compensator']._pose.bending(), 0.0
    master.move(1.2)
    assert len(corrections) > 1.1 * TICK_RATE
    assert foreign.diagnostics['controller: feedback'][-1].message == 'in the loop'


def test_a_velocity_that_belies_the_positions_moves_nothing(foreign, master):
    master.move(0.2)
    for _ in range(ticks(0.6)):
        master.tick(velocity=[0.0, 0.0])
    moved = Moved(foreign)
    for k in range(ticks(1.0)):
        master.tick(velocity=[0.5 if k % ticks(0.1) == 0 else 0.0] * 2)
    assert moved.largest_step < TICK_S
    assert moved.of_tip < 0.02


def test_nothing_moves_unless_enabled_and_while_the_clutch_is_held(foreign, master):
    moved, refused = Moved(foreign), foreign.nodes['compensator'].stream.gate.refused
    master.move(0.04)
    master.clutch = None
    master.move(1.2)
    # A clutch that falls silent is released.
    assert 0.34 * TICK_RATE <= len(moved.goals) <= 0.38 * TICK_RATE
    for clutch in (0, None):
        master.clutch = clutch
        moved.clear()
        before = refused['clutch not held']
        master.move(0.2)
        assert moved.goals == []
        assert refused['clutch not held'] == before + ticks(0.2)
    assert foreign.state == 'ENABLED'
    assert foreign.command('disable') == 'DISABLED'
    master.clutch = 1
    moved.clear()
    master.move(0.2)
    assert moved.goals == []
    assert moved.of_shafts < STILL


def test_commands_that_end_with_the_clutch_held_end_the_session(foreign, master):
    master.move(0.6)
    moved = Moved(foreign)
    foreign.advance(0.3)
    assert foreign.state == 'FAULT'
    assert 'slave/servo_jp ended while the clutch was held' in foreign.cause
    moved.clear()
    foreign.advance(0.5)
    assert moved.of_shafts < STILL


def test_home_is_said_to_be_reached_where_it_is(foreign, master):
    master.move(1.2)
    master.hold(0)
    foreign.advance(0.2)
    foreign.nodes['motor_driver']._device.set_torque(False)
    shafts = foreign.listen(MOTOR_MEASURED, MOTORS)
    foreign.command('home')
    for _ in range(20):
        foreign.advance(0.1)
        if foreign.state == 'FAULT':
            break
    assert max(map(abs, shafts[-1].position)) > 0.1
    assert 'stands still: its goal has gone' in foreign.cause
    assert 'home reached' not in foreign.reported('calibration: procedure')['last']


def test_commands_that_are_refused_while_the_clutch_is_held_are_a_fault_and_said(foreign, master):
    moved = Moved(foreign)
    master.way = 0.3
    while foreign.state == 'ENABLED' and master.sent < TICK_RATE:
        master.tick()
    assert 0.3 <= master.sent / TICK_RATE <= 0.4
    assert 'slave/servo_jp: ' in foreign.cause
    assert 'commands are refused, last: too far from the measured position' in foreign.cause
    foreign.command('disable')
    foreign.advance(0.2)
    foreign.enable()
    assert moved.goals == []
    master.way = 0.0
    master.move(0.2)
    assert foreign.state == 'ENABLED'
    assert len(moved.goals) > ticks(0.1)


# ---- the handle


def test_engaging_re_references_without_a_jump():
    with run(overrides={'master': {'source': 'master', 'scale': 0.5}}) as graph:
        commands = graph.listen(SLAVE_COMMAND)
        handle = Handle(graph)
        handle.move(0.4, (0.5, 0.0))
        assert commands[0].position == pytest.approx((0.0, 0.0), abs=0.02)
        assert 0.05 < commands[-1].position[0] < 0.12
        handle.move(0.5, (2.0, 2.0), clutch=False)
        released = len(commands)
        handle.move(0.2, (2.0, 2.0), clutch=False)
        assert len(commands) == released
        pose = graph.nodes['master']._pose.bending()
        handle.move(0.4, (0.0, 0.5))
        assert commands[released].position == pytest.approx(pose, abs=0.02)
        steps = np.abs(np.diff([c.position for c in commands[released:]], axis=0))
        assert steps.max() < 0.006


def test_a_clutch_held_through_an_interrupted_calibration_moves_nothing():
    """The master engages at the measured pose, not at its own last command."""
    with run(overrides={'master': {'source': 'master'}}) as graph:
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


def test_unusable_handle_messages_are_counted_and_said():
    with run(overrides={'master': {'source': 'master'}}) as graph:
        handle = Handle(graph)
        handle.move(0.2)
        handle.send([math.nan, 0.0], session='')
        handle.send([0.0, 0.0], session='', name=['elbow', 'wrist'])
        graph.advance(1.1)
        told = [s.message for s in graph.diagnostics['master: commands']]
        assert any('elbow' in message or 'not finite' in message for message in told)
        values = graph.reported('master: commands')
        assert values['handle refused: not finite'] == values['handle refused: malformed'] == '1'


def test_a_handle_that_nothing_follows_is_said_with_what_to_do():
    with run() as graph:
        master, said = graph.nodes['master'], []
        master.get_logger = lambda: SimpleNamespace(warning=said.append)
        handle = Handle(graph)
        handle.move(1.1, clutch=False)
        assert not said
        handle.move(3.0, (0.05, 0.0), clutch=False)
        advice = 'endoscope operate set master.source master'
        told = graph.diagnostics['master: commands'][-1]
        assert told.level == WARN
        assert told.message == (
            f"the handle moves and nothing follows it: the master's source is none; {advice}"
        )
        assert said == [told.message]
        handle.move(1.1)
        assert 'has its clutch held' in graph.diagnostics['master: commands'][-1].message
        # Unless a program commands the slave.
        graph.speak(JointState, SLAVE_COMMAND, COMMAND)
        handle.move(1.1)
        assert graph.diagnostics['master: commands'][-1].level == OK


def test_a_handle_that_falls_silent_stands_and_is_taken_up_where_the_slave_is():
    with run(overrides={'master': {'source': 'master'}}) as graph:
        handle = Handle(graph)
        handle.move(1.0, (0.5, 0.5))
        moved = Moved(graph)
        clutch = handle.clutch_publisher
        for _ in range(10):
            clutch.publish(Joy(buttons=[1]))
            graph.advance(0.05)
        moved.clear()
        handle.angle = handle.angle + 0.7
        handle.move(0.5)
        assert graph.state == 'ENABLED'
        assert moved.of_shafts < 0.02

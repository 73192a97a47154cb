"""`endoscope teleop` in a pseudo-terminal: keys move the slave, and nothing else does."""

import os
import signal
import subprocess
import termios
import time
from itertools import pairwise

import numpy as np
import pytest
import rclpy
from operated_graph import ENDOSCOPE, OperatedGraph, Typist
from sensor_msgs.msg import Joy
from simulated_graph import TICK_RATE

from endoscope_nodes.names import MASTER_CLUTCH
from endoscope_nodes.runtime.qos import EVENT

UP, W, A, H = b'\x1b[A', b'w', b'a', b'h'
FAR = 0.06


@pytest.fixture(scope='module')
def running(tmp_path_factory):
    with OperatedGraph(tmp_path_factory.mktemp('operated'), tick_rate=TICK_RATE) as graph:
        yield graph


def is_seen_from_outside(graph, name):
    """Whether a program that begins now finds a node: an old one may remember it for ever."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=graph.domain)
    try:
        asking = rclpy.create_node('asking', context=context)
        time.sleep(1.0)
        return name in asking.get_node_names()
    finally:
        rclpy.shutdown(context=context)


@pytest.fixture
def graph(running):
    # A handle that was killed is missed by the middleware in its own time.
    running.until(
        lambda: (
            'teleop' not in running.probe.get_node_names()
            or not is_seen_from_outside(running, 'teleop')
        ),
        'the end of teleop',
    )
    running.command('disable')
    running.set('master', source='none', scale=1.0)
    running.clutches.clear()
    return running


def moved(typist):
    """How far each joint was asked to go since it was first asked, rad."""
    if not typist.wanted:
        return np.zeros(2)
    return np.subtract(typist.wanted[-1].position, typist.wanted[0].position)


def strayed(graph, typist, joint):
    """How far a joint was asked to go within grips, rad: each begins where the slave is measured.

    A busy machine makes several grips of one, and so many steps are no motion.
    """
    grips = sum(after > before for before, after in pairwise([0, *graph.clutches]))
    steps = np.abs(np.diff([goal.position[joint] for goal in typist.wanted]))
    return np.sort(steps)[: len(steps) - grips].sum()


def check_left_as_found(graph, typist):
    typist.until(lambda: graph.clutches[-1] == 0, 'the release')
    assert graph.nodes['master'].get_parameter('source').value == 'none'
    if typist.slave is not None:
        assert termios.tcgetattr(typist.slave) == typist.before


def test_a_held_key_moves_the_slave_and_its_release_stops_it(graph):
    with Typist(graph, '--take') as typist:
        typist.enable()
        typist.type(UP)
        assert typist.stands()
        assert not typist.goals
        typist.hold(UP, until=lambda: moved(typist)[1] > FAR)
        assert 'FOLLOW' in typist.text
        assert strayed(graph, typist, joint=0) < 0.01
        typist.shows('OPEN')
        assert 1 in graph.clutches
        assert graph.clutches[-1] == 0
        assert typist.stands()
        typist.wanted.clear()
        typist.hold(A, until=lambda: moved(typist)[0] < -FAR)
        typist.shows('OPEN')
        assert typist.stands()
        assert strayed(graph, typist, joint=1) < 0.01
        typist.type(b'q')
        assert typist.end() == 0
        check_left_as_found(graph, typist)
    assert graph.state == 'ENABLED'


@pytest.mark.nightly
def test_a_signal_releases_the_clutch_and_restores_everything(graph):
    with Typist(graph, '--take', '--scale', '0.5') as typist:
        typist.enable()
        typist.until(lambda: graph.nodes['master'].get_parameter('scale').value == 0.5)
        typist.hold(W, until=lambda: moved(typist)[1] > FAR)
        typist.process.send_signal(signal.SIGTSTP)
        assert typist.end() == 128 + signal.SIGTSTP
        check_left_as_found(graph, typist)
        assert graph.nodes['master'].get_parameter('scale').value == 1.0
        assert typist.stands()


@pytest.mark.nightly
def test_a_terminal_that_is_closed_releases_the_clutch(graph):
    with Typist(graph, '--take') as typist:
        typist.enable()
        typist.hold(W, until=lambda: moved(typist)[1] > FAR)
        typist.hang_up()
        assert typist.end() == 128 + signal.SIGHUP
        check_left_as_found(graph, typist)
        assert typist.stands()


def test_a_program_that_is_killed_moves_nothing_any_more(graph):
    with Typist(graph, '--take') as typist:
        typist.enable()
        typist.hold(W, until=lambda: moved(typist)[1] > FAR)
        typist.process.kill()
        typist.process.wait()
        # Until the handle and the clutch are missed: 0.1 and 0.35 s.
        graph.advance(0.5)
        assert typist.stands()


@pytest.mark.nightly
def test_home_goes_on_while_its_key_is_held_and_is_paused_otherwise(graph):
    with Typist(graph, '--take', '--speed', '57') as typist:
        typist.enable()
        typist.hold(W, until=lambda: typist.wanted and typist.wanted[-1].position[1] > 0.3)
        typist.shows('OPEN')
        typist.hold(H, until=lambda: graph.nodes['calibration'].active)
        typist.shows('PAUSED')
        assert not graph.nodes['calibration'].active
        assert typist.stands()
        homed = graph.nodes['calibration'].orders
        # A key that a busy machine repeats too late is a key let go, and pauses once more.
        while not homed.last.startswith('home reached'):
            typist.type(b'e')
            typist.shows('ENABLED')
            typist.hold(
                H,
                until=lambda: homed.last.startswith('home reached') or graph.state == 'PAUSED',
                longest_s=120.0,
            )
        typist.shows('OPEN')
        assert typist.stands()
        assert graph.state == 'ENABLED'
        assert max(abs(x) for x in typist.goals[-1].position) < 0.01


def test_it_says_why_nothing_moves_and_what_the_master_played_does_not_begin_anew(graph):
    graph.set('master', source='motion')
    with Typist(graph, '--take') as typist:
        typist.shows('E enables')
        began = graph.clock.now_ns
        typist.hold(W, until=lambda: graph.clock.now_ns > began + 1_000_000_000)
        assert 1 not in graph.clutches
        assert not typist.wanted
        typist.type(b'e')
        typist.shows('ENABLED')
        typist.type(b'p')
        typist.shows('E resumes')
        typist.type(b']')
        typist.shows('21 deg/s')
        typist.type(b'e')
        typist.shows('ENABLED')
        typist.type(b'\x03')
        assert typist.end() == 128 + signal.SIGINT
        assert termios.tcgetattr(typist.slave) == typist.before
        assert graph.nodes['master'].get_parameter('source').value == 'motion'
        assert graph.state == 'PAUSED'
        assert 'starts again when you resume' in typist.text
        assert typist.stands()


def test_it_asks_before_it_takes_the_handle(graph):
    with Typist(graph) as typist:
        typist.until(lambda: 'Set it to master until teleop ends? [y/N]' in typist.text)
        typist.type(b'n\n')
        assert typist.end() == 1
        assert graph.nodes['master'].get_parameter('source').value == 'none'
        assert 'nothing would follow the keys' in typist.text


def test_another_handle_is_left_alone(graph):
    publisher = graph.speak(Joy, MASTER_CLUTCH, EVENT)
    with Typist(graph, '--take') as typist:
        assert typist.end() == 1
        assert 'the handle topics are already published by probe' in typist.text
        assert graph.nodes['master'].get_parameter('source').value == 'none'
    graph.probe.destroy_publisher(publisher)


def test_without_a_terminal_it_says_so():
    process = subprocess.run(
        [*ENDOSCOPE, 'teleop'],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {'ROS_DOMAIN_ID': '99'},
    )
    assert process.returncode == 2
    assert process.stderr.splitlines() == [
        'endoscope: teleop needs a terminal, and stdin is not one: a held key is its dead-man'
    ]

"""A motion that is played goes on only while the operator holds on."""

import numpy as np
import pytest
from commanded_graph import BOUND, STILL, TICK_RATE, Moved, run
from sensor_msgs.msg import Joy

from endoscope_core.signals.sampled_motion import write_command_file
from endoscope_nodes.names import MASTER_CLUTCH
from endoscope_nodes.nodes.master import WAITING
from endoscope_nodes.runtime.qos import EVENT

REACH = 0.6
RAMP_S = 1.0


class Hand:
    """A clutch at 10 Hz, as an operator's program says it."""

    def __init__(self, graph):
        self._graph = graph
        self.clutch_publisher = graph.speak(Joy, MASTER_CLUTCH, EVENT)

    def says(self, held, seconds):
        for _ in range(round(10 * seconds)):
            self.clutch_publisher.publish(Joy(buttons=[int(held)]))
            self._graph.advance(0.1)


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    file = tmp_path_factory.mktemp('motion') / 'motion.csv'
    angle = np.linspace(0.0, REACH, 101)
    write_command_file(file, np.linspace(0.0, RAMP_S, 101), np.stack([angle, -angle], axis=1))
    with run(overrides={'master': {'command_file': str(file), 'hold_to_play': True}}) as graph:
        yield graph


@pytest.fixture
def hand(graph):
    """An operator's hand that is off, a session of its own, and the file from its beginning."""
    graph.command('disable')
    graph.enable()
    hand = Hand(graph)
    graph.set('master', source='file')
    yield hand
    graph.set('master', source='none')
    graph.probe.destroy_publisher(hand.clutch_publisher)
    graph.connect()


def said(graph):
    report = graph.diagnostics['master: commands'][-1]
    values = graph.reported('master: commands')
    return report.message, float(values['progress [s]'])


def test_it_plays_while_the_clutch_is_held_rests_at_release_and_goes_on_from_there(graph, hand):
    commands = graph.listen('slave/servo_jp')
    moved = Moved(graph)
    hand.says(False, 1.1)
    assert said(graph) == (WAITING, 0.0)
    assert commands == []
    assert moved.of_shafts < STILL

    hand.says(True, 0.8)
    *_, last = commands
    assert 0.1 * REACH < last.position[0] < REACH
    hand.says(False, 0.3)
    assert last.stamp_ns > commands[-1].stamp_ns - 100_000_000
    commands.clear()
    moved.clear()
    hand.says(False, 1.1)
    waits, stood = said(graph)
    assert waits == WAITING
    assert 0.0 < stood < RAMP_S
    assert commands == []
    assert moved.of_shafts < STILL
    assert graph.state == 'ENABLED'

    # Friction has left the tip behind: the way there is made again, and the motion goes on.
    hand.says(True, 2.2)
    assert said(graph) == ('finished', pytest.approx(RAMP_S, abs=0.01))
    assert commands[0].position[0] < last.position[0] - STILL
    assert commands[-1].position == pytest.approx((REACH, -REACH))
    assert moved.largest_step < BOUND
    assert graph.state == 'ENABLED'


def test_silence_or_a_pause_ends_it_and_what_is_resumed_waits_for_the_hand(graph, hand):
    commands = graph.listen('slave/servo_jp')
    hand.says(True, 0.4)
    assert commands
    graph.advance(0.4)
    commands.clear()
    graph.advance(0.3)
    assert commands == []
    hand.says(True, 0.3)
    assert graph.command('pause') == 'PAUSED'
    hand.says(False, 0.1)
    assert graph.command('resume') == 'ENABLED'
    commands.clear()
    hand.says(False, 0.5)
    assert commands == []
    hand.says(True, 0.3)
    assert commands


def test_the_master_leaves_the_clutch_to_the_operator_and_takes_it_back():
    with run(overrides={'master': {'hold_to_play': True}}) as graph:
        console = graph.nodes['master']
        clutch = f'{console.get_namespace()}/{MASTER_CLUTCH}'
        graph.set('master', source='motion')
        commands = graph.listen('slave/servo_jp')
        graph.advance(0.3)
        assert console.count_publishers(clutch) == 0
        assert commands == []
        graph.set('master', hold_to_play=False)
        graph.advance(0.6)
        assert console.count_publishers(clutch) == 1
        assert len(commands) > 0.5 * TICK_RATE
        graph.set('master', hold_to_play=True)
        graph.advance(0.1)
        commands.clear()
        graph.advance(0.3)
        assert console.count_publishers(clutch) == 0
        assert commands == []
        assert graph.state == 'ENABLED'

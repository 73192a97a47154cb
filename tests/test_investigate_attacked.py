"""While a motion is played for an investigation, nothing moves that nobody asked for.

One graph for all, in simulated time; after every attack it is enabled anew and has to stand still.
"""

import json
import time

import numpy as np
import pytest
from commanded_graph import STILL, Moved, Sender
from operated_graph import OperatedGraph
from security_policy import NAMESPACE, allowed
from sensor_msgs.msg import Joy
from simulated_graph import SimulatedGraph

from endoscope_bags import open_bag
from endoscope_core.errors import NotPlayedError, RigStoppedError
from endoscope_core.names import JOINTS
from endoscope_core.physics import PlantDescription, save_plant
from endoscope_core.signals import hold, move, sequence
from endoscope_core.signals.sampled_motion import CommandTable, write_command_file
from endoscope_explain.investigation.motions import RigMotion
from endoscope_nodes.client import motion_player
from endoscope_nodes.client.graph_client import GraphClient
from endoscope_nodes.client.graph_listener import GraphError
from endoscope_nodes.client.motion_player import MotionPlayer
from endoscope_nodes.names import MASTER_CLUTCH, SLAVE_COMMAND
from endoscope_nodes.runtime.qos import EVENT

pytestmark = pytest.mark.engine

UNDER_WAY = 0.2
"""Shaft angle in rad at which the motion is under way."""
PATIENCE_S = 240.0
STOPS_S = 0.6
"""Until the last one has noticed: three missed words of the clutch, and the way to a standstill."""


@pytest.fixture(scope='module')
def graph(tmp_path_factory):
    with OperatedGraph(tmp_path_factory.mktemp('attacked')) as graph:
        yield graph


@pytest.fixture(scope='module')
def motion(tmp_path_factory):
    signal = sequence('there and back', [move(0.0, 0.6, 1.2), move(0.6, 0.0, 1.2), hold(0.2)])
    ticks = np.arange(0.0, signal.duration, 0.01)
    angle = np.stack([signal(ticks)[0], np.zeros_like(ticks)], axis=1)
    file = tmp_path_factory.mktemp('motion') / 'motion.csv'
    write_command_file(file, ticks, angle)
    return RigMotion('there and back', 'bend_x', '', CommandTable(JOINTS, ticks, angle)), file


@pytest.fixture
def strangers(graph):
    """What strangers publish with, until the test is over."""
    found = []
    yield found
    gone(graph, found)


def gone(graph, strangers):
    while strangers:
        graph.probe.destroy_publisher(strangers.pop())
    graph.connect()


class Attacked(GraphClient):
    """A client beside whose waiting the graph goes on; something happens while a motion plays."""

    def __init__(self, graph, happens, beside):
        super().__init__(graph.probe, self._live, lambda: graph.clock.now_ns * 1e-9)
        self._graph, self.happens, self._beside = graph, happens, beside

    def _live(self, seconds):
        graph = self._graph
        self._beside(self)
        graph.advance(seconds)
        moving = graph.goals and abs(graph.goals[-1].position[0]) > UNDER_WAY
        if self.happens is not None and self.state == 'ENABLED' and moving:
            happens, self.happens = self.happens, None
            happens()


def parameters(graph):
    """What an investigation sets in nodes that it does not ask to stay so."""
    return {
        f'{node}.{name}': parameter.value
        for node in ('compensator', 'controller', 'master')
        for name, parameter in graph.nodes[node].get_parameters_by_prefix('').items()
        if not isinstance(parameter.value, list)
    }


def attacked(graph, motion, folder, happens, beside=lambda client: None, **of_player):
    """Play a motion during which something happens; how it ended."""
    graph.command('disable')
    graph.advance(0.5)
    graph.goals.clear()
    ended = None
    with Attacked(graph, happens, beside) as client:
        try:
            MotionPlayer(client, lambda words: True, **of_player).play(*motion, folder / 'bag')
        except (NotPlayedError, RigStoppedError, GraphError) as error:
            ended = error
    assert client.happens is None, ended
    return ended


def stands_still(graph):
    """Whether nothing moves, in the session that is there and in a new one."""
    graph.advance(STOPS_S)
    moved = Moved(graph)
    graph.advance(0.5)
    before = moved.of_shafts
    graph.command('disable')
    graph.advance(0.5)
    graph.enable()
    moved.clear()
    graph.advance(1.0)
    now = moved.of_shafts
    graph.command('disable')
    return before < STILL and now < STILL


@pytest.mark.nightly
def test_a_stranger_who_commands_is_a_fault(graph, motion, tmp_path, strangers):
    def happens():
        sender = Sender(graph, SLAVE_COMMAND)
        strangers.append(sender.publisher)
        for _ in range(5):
            sender.send((0.5, 0.5))
            graph.advance(0.01)

    error = attacked(graph, motion, tmp_path, happens)
    assert isinstance(error, RigStoppedError)
    assert 'senders' in str(error)
    gone(graph, strangers)
    assert stands_still(graph)


@pytest.mark.nightly
def test_a_session_that_is_taken_ends_the_motion(graph, motion, tmp_path):
    def happens():
        graph.command('pause')
        graph.command('resume')

    error = attacked(graph, motion, tmp_path, happens)
    assert isinstance(error, NotPlayedError), error
    assert stands_still(graph)


def test_a_dead_man_who_lets_go_stops_the_motion(graph, motion, tmp_path, strangers):
    strangers.append(graph.speak(Joy, MASTER_CLUTCH, EVENT))
    let_go_ns = []

    def beside(client):
        if client.state != 'ENABLED':
            client.order('enable')
        strangers[0].publish(Joy(buttons=[int(not let_go_ns)]))

    def since_let_go():
        return bool(let_go_ns) and graph.clock.now_ns - let_go_ns[0] > 1.5e9

    error = attacked(
        graph,
        motion,
        tmp_path,
        lambda: let_go_ns.append(graph.clock.now_ns),
        beside,
        hold_to_play=True,
        withdrawn=since_let_go,
    )
    assert isinstance(error, NotPlayedError), error
    late = [g.position for g in graph.goals if g.stamp_ns > let_go_ns[0] + STOPS_S * 1e9]
    assert not late or np.ptp(late, axis=0).max() < STILL
    assert stands_still(graph)


def test_a_master_that_dies_ends_the_motion(graph, motion, tmp_path, monkeypatch):
    # What it then asks in vain is waited for less long, so that the test is not.
    monkeypatch.setattr(motion_player, 'PATIENCE_S', 5.0)
    moved = []

    def dies():
        graph.kill('master')
        graph.advance(STOPS_S)
        moved.append(Moved(graph))

    error = attacked(graph, motion, tmp_path, dies)
    assert error is not None
    assert moved[0].of_shafts < STILL
    SimulatedGraph.start(graph, 'master')
    graph.advance(1.0)
    assert stands_still(graph)


def test_a_program_that_is_killed_moves_nothing_on_and_is_in_no_way(graph, motion, tmp_path):
    save_plant(PlantDescription(), tmp_path / 'plant.yaml')
    graph.command('disable')
    graph.advance(0.5)
    graph.set('master', source='master')
    before = parameters(graph)
    graph.goals.clear()
    words = ['--plant', str(tmp_path / 'plant.yaml'), '--out', str(tmp_path / 'out')]
    program = OperatedGraph.start(graph, 'investigate', *words, '--attended')
    try:
        end = time.monotonic() + PATIENCE_S
        while not (graph.goals and abs(graph.goals[-1].position[0]) > UNDER_WAY):
            assert program.poll() is None, program.communicate()
            assert time.monotonic() < end
            graph.pace()
        of = 'investigate', NAMESPACE
        published = graph.probe.get_publisher_names_and_types_by_node(*of)
        heard = graph.probe.get_subscriber_names_and_types_by_node(*of)
        called = graph.probe.get_client_names_and_types_by_node(*of)
    finally:
        program.kill()
        program.communicate()
    assert graph.state == 'ENABLED'
    changed = dict(set(parameters(graph).items()) - set(before.items()))
    assert {'compensator.mode', 'controller.active', 'master.source'} <= set(changed)
    graph.command('disable')
    graph.advance(0.2)
    assert parameters(graph) == before
    graph.set('master', source='none')
    assert stands_still(graph)
    log = json.loads((tmp_path / 'out' / 'log.json').read_text())
    assert [each['recorded'] for each in log['rounds']] == [False]

    # The security policy allows what it does.
    may, them = allowed(), ('investigate', 'operator', 'console_web')
    assert {name for name, _ in published} <= may['investigate']['publish']
    assert all({name for name, _ in heard} <= may[each]['subscribe'] for each in them)
    assert {name for name, _ in called} <= may['investigate']['request']

    # The middleware takes a while to give it up as a sender; what it was recording stays.
    graph.wait(lambda: 'investigate' not in graph.probe.get_node_names())
    assert attacked(graph, motion, tmp_path, lambda: None) is None
    assert open_bag(tmp_path / 'out' / 'bag_1').joint_state(SLAVE_COMMAND).stamp_ns.size

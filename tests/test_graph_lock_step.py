"""Simulated time: twice the same, the same as the plant alone, a clear word when it stalls."""

import subprocess
import sys

import numpy as np
import pytest
from simulated_graph import SimulatedGraph

from endoscope_core.physics import PlantDescription, SensorModel, simulate
from endoscope_nodes.graph import ALL_NODES, SHOWING_NODES
from endoscope_nodes.names import MOTORS, WIRES
from endoscope_nodes.nodes.recorder import RecorderNode
from endoscope_nodes.nodes.simulation_clock import BarrierTimeout

STREAMS = {
    'slave/servo_jp': ('bend_x', 'bend_y'),
    'motor/servo_jp': MOTORS,
    'motor/measured_js': MOTORS,
    'wires/measured_js': WIRES,
    'slave/measured_js': ('bend_x', 'bend_y'),
    'controller/correction_js': ('bend_x', 'bend_y'),
    'calibration/servo_jp': ('bend_x', 'bend_y'),
}


def calibration(clock):
    """Result but for its time, and what was commanded and read in a motion before it and in it."""
    overrides = {'calibration': {'motion': 'brief'}, 'simulation_clock': clock}
    with SimulatedGraph(overrides=overrides, tick_rate=250) as graph:
        streams = {topic: graph.listen(topic, names) for topic, names in STREAMS.items()}
        graph.enable()
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(1.0)
        graph.set('master', source='none')
        graph.advance(0.5)
        result = graph.calibrate()
    end = streams['calibration/servo_jp'][-1].stamp_ns
    heard = {topic: [s for s in stream if s.stamp_ns <= end] for topic, stream in streams.items()}
    return {key: value for key, value in result.items() if 'duration' not in key}, heard


@pytest.mark.parametrize('others', [0, pytest.param(2, marks=pytest.mark.nightly)])
def test_calibration_and_motion_at_a_pace_beside_busy_processes_is_the_same_to_the_last_bit(others):
    alone = calibration({})
    busy = [subprocess.Popen([sys.executable, '-c', 'while True: pass']) for _ in range(others)]
    try:
        beside = calibration({'speed': 5.0})
    finally:
        for process in busy:
            process.kill()
            process.wait()
    assert all(alone[1].values())
    assert len(alone[1]['wires/measured_js']) > 1000
    assert beside == alone


def test_another_seed_gives_other_noise():
    def wires(seed):
        with SimulatedGraph(overrides={'motor_driver': {'seed': seed}}) as graph:
            samples = graph.listen('wires/measured_js', WIRES)
            graph.advance(0.05)
            return samples

    assert wires(5) != wires(6)


def test_the_graphs_motors_are_the_plants():
    """A command acts from its stamp until the next: replaying them gives the same readings."""
    with SimulatedGraph(tick_rate=1000) as graph:
        shafts = graph.listen('motor/measured_js', MOTORS)
        wires = graph.listen('simulation/wires', WIRES)
        drives = graph.listen('motor/servo_jp', MOTORS)
        graph.enable()
        graph.set('master', source='motion')
        graph.advance(2.0)
    commands = np.zeros((len(shafts), 2))
    in_force = {d.stamp_ns: d.position for d in drives}
    for k, shaft in enumerate(shafts):
        commands[k] = in_force.get(shaft.stamp_ns, commands[k - 1])
    plant = PlantDescription()
    answer = simulate(plant, commands)
    np.testing.assert_allclose(
        [w.effort for w in wires], answer.tension.reshape(len(wires), 4), atol=1e-9
    )
    read = SensorModel(plant.sensors, 1)
    np.testing.assert_allclose(
        [s.position for s in shafts], read.shaft_position(answer.shaft_position), atol=1e-12
    )


def test_the_topic_that_is_waited_for_is_named():
    overrides = {'simulation_clock': {'timeout': 0.2}}
    with (
        SimulatedGraph(without=('load_cells',), overrides=overrides) as graph,
        pytest.raises(BarrierTimeout, match='wires/measured_js'),
    ):
        graph.advance(0.1)


def test_no_entity_of_the_composed_graph_has_an_event_of_the_middleware(tmp_path):
    """Such events can dead-lock the executor of the nodes, or crash it when they are destroyed."""
    shown = (*SHOWING_NODES, RecorderNode)
    with SimulatedGraph(extra=shown, overrides={'recorder': {'bag': f'{tmp_path}/bag'}}) as graph:
        assert {type(node) for node in graph.runtime.nodes} >= set(ALL_NODES)
        for node in graph.runtime.nodes:
            assert not list(node.waitables), node.get_name()
            for entity in (*node.publishers, *node.subscriptions):
                assert not entity.event_handlers, (node.get_name(), entity.topic_name)

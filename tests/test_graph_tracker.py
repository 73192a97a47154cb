"""A tracker that goes blind, dies, or reads single samples wrong."""

import numpy as np
import pytest
from commanded_graph import BOUND, TICK_RATE
from simulated_graph import SimulatedGraph
from tubes import slave_of

from endoscope_core.physics import EffectSpec, PlantDescription

CALIBRATION = {'calibration': {'motion': 'brief'}}


def weight(graph):
    return graph.nodes['controller'].controller.weight


def test_a_blind_tracker_fades_the_feedback_out_and_back_in_without_a_jump():
    with SimulatedGraph(overrides=CALIBRATION, tick_rate=TICK_RATE) as graph:
        drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
        corrections = graph.listen('controller/correction_js')
        graph.advance(2.0)
        at_rest = graph.diagnostics['controller: feedback'][-1]
        assert (at_rest.level, at_rest.message) == (b'\x00', 'waiting for slave/servo_jp')
        graph.enable()
        graph.calibrate()
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(4.0)
        assert weight(graph) == 1.0
        drives.clear()
        corrections.clear()
        graph.set('em_tracker', in_volume=False)
        graph.advance(2.0)
        assert weight(graph) == 0.0
        assert corrections[-1].position == (0.0, 0.0)
        assert np.abs(corrections[0].position).max() > 0.01
        graph.advance(1.0)
        assert len(drives) == 3 * TICK_RATE
        assert 'feed-forward alone' in graph.diagnostics['controller: feedback'][-1].message
        assert graph.diagnostics['em_tracker: tracker'][-1].level == b'\x03'
        graph.set('em_tracker', in_volume=True)
        graph.advance(2.0)
        assert weight(graph) == 1.0
        change = np.abs(np.diff([c.position for c in corrections], axis=0))
        # The law itself steps by 0.01 rad where the motion turns; the whole correction is 0.09.
        assert change.max() < 0.02
        assert graph.states[-1] == 'ENABLED'


@pytest.mark.nightly
def test_a_dead_tracker_node_leaves_the_feed_forward_going_and_comes_back_without_a_jump():
    with SimulatedGraph(overrides=CALIBRATION, tick_rate=TICK_RATE) as graph:
        drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
        graph.enable()
        graph.calibrate()
        graph.set('master', source='motion')
        graph.advance(3.0)
        graph.kill('em_tracker')
        drives.clear()
        graph.advance(2.0)
        assert len(drives) == 2 * TICK_RATE
        assert weight(graph) == 0.0
        graph.start('em_tracker')
        graph.advance(2.0)
        assert weight(graph) > 0.9
        steps = np.abs(np.diff([s.position for s in drives], axis=0))
        assert steps.max() < BOUND
        assert graph.states[-1] == 'ENABLED'


def test_wrong_samples_are_in_the_readings_and_not_in_the_rig(tmp_path):
    wrong = EffectSpec('tracker_outliers', 'bend_y', {'rate': 0.1, 'size_rad': 0.3})
    overrides = slave_of(PlantDescription(effects=(wrong,)), tmp_path / 'plant.yaml')
    with SimulatedGraph(overrides=overrides) as graph:
        read, true = (graph.listen(t) for t in ('slave/measured_js', 'simulation/bending'))
        graph.advance(5.0)
    bending = {sample.stamp_ns: sample.position for sample in true}
    off = np.array([np.subtract(s.position, bending[s.stamp_ns]) for s in read])
    assert len(off) == 200
    assert np.abs(off[:, 0]).max() < 0.05
    spoilt = np.abs(off[:, 1]) > 0.15
    # 20 of 200 are expected, with a standard deviation of 4.
    assert 8 <= np.count_nonzero(spoilt) <= 32
    np.testing.assert_allclose(np.abs(off[spoilt, 1]), 0.3, atol=0.03)

"""Every compensator as a mode of the running nodes, changed while the slave moves."""

import numpy as np
from simulated_graph import TICK_RATE, SimulatedGraph
from tubes import tube_of_size

from endoscope_core.control import MODES
from endoscope_core.identification.law_choice import CalibrationFindings


def test_every_mode_comes_in_while_moving_without_a_jump(tmp_path):
    """The physical modes by the plant that the calibration identified, the others by size."""
    overrides = tube_of_size(tmp_path, 72, 11)
    with SimulatedGraph(overrides=overrides) as graph:
        drives = graph.listen('motor/servo_jp', ('motor_x', 'motor_y'))
        graph.enable()
        graph.calibrate()
        node = graph.nodes['compensator']
        assert node._compiled == {'bouc_wen'}
        assert len(node.findings.plants) == 2
        graph.set('master', source='motion')
        graph.advance(2.0)
        for mode in (*MODES[1:], 'none', 'bouc_wen'):
            graph.set('compensator', selected_by='plant' if 'physical' in mode else 'size')
            graph.advance(0.1)
            drives.clear()
            graph.set('compensator', mode=mode)
            graph.advance(0.02)
            assert node._feedforward.law.mode == mode
            assert mode in node._compiled
            steps = np.abs(np.diff([s.position for s in drives], axis=0))
            assert len(drives) >= 0.02 * TICK_RATE
            # 20 rad/s at the joint is what the feed-forward allows itself; a jump would be 0.1 rad.
            assert steps.max() <= 0.5 * 20.0 / TICK_RATE + 1e-9


def test_what_the_calibration_did_not_find_is_not_guessed():
    with SimulatedGraph() as graph:
        graph.enable()
        graph.nodes['compensator'].findings = CalibrationFindings(70)
        graph.set('compensator', mode='physical', selected_by='plant')
        graph.advance(0.3)
        assert graph.nodes['compensator']._feedforward.law.mode == 'none'

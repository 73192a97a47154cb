"""The force at the tip in the real graph: bounds from a calibration, then something pushes."""

import math

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from simulated_graph import SimulatedGraph

from endoscope_core.kinematics import tip_lever
from endoscope_core.physics import EffectSpec, PlantDescription, save_plant
from endoscope_core.rig import shipped_rig
from endoscope_nodes.names import TIP_FORCE
from endoscope_nodes.nodes.tip_force import TipForceNode
from endoscope_nodes.runtime.diagnostics import OK, WARN
from endoscope_nodes.runtime.qos import SENSOR_ASKED

PUSHED_AT_S, MOMENT_NM = 24.0, 0.003
"""After the plant began, with the first tick of the clock."""
CLOCK_START_S = 1.0


@pytest.fixture(scope='module')
def pushed(tmp_path_factory):
    """The graph once something has pushed for a second; forces, and reports before and then."""
    file = tmp_path_factory.mktemp('tip_force') / 'pushed.yaml'
    values = {'moment_nm': MOMENT_NM, 'time_s': PUSHED_AT_S, 'duration_s': 0.2}
    save_plant(PlantDescription(effects=(EffectSpec('external_load', 'bend_y', values),)), file)
    overrides = {
        'motor_driver': {'plant_file': str(file)},
        'calibration': {'motion': 'sinusoid'},
        'master': {'source': 'motion', 'motion': 'periodic'},
    }
    with SimulatedGraph(extra=(TipForceNode,), overrides=overrides) as graph:
        forces: list[WrenchStamped] = []
        graph.probe.create_subscription(WrenchStamped, TIP_FORCE, forces.append, SENSOR_ASKED)
        graph.connect()
        graph.enable()
        reports = {'first': _report(graph)}
        graph.calibrate()
        left = PUSHED_AT_S - 2.0 - (1e-9 * graph.clock.now_ns - CLOCK_START_S)
        assert left > 2.0
        graph.advance(left)
        free = len(forces)
        reports['free'] = _report(graph)
        graph.advance(2.5)
        reports['pushed'] = _report(graph)
        yield graph, forces, free, reports


def _report(graph):
    graph.advance(1.1)
    status = graph.diagnostics['tip_force: force'][-1]
    return status.level, status.message, {v.key: v.value for v in status.values}


def test_before_a_calibration_there_is_no_force_and_it_says_why(pushed):
    _, _, _, reports = pushed
    level, message, _ = reports['first']
    assert level == OK
    assert message.startswith('no force: ')


def test_free_motion_is_quiet_and_what_pushes_is_measured(pushed):
    _, forces, free, reports = pushed
    level, message, values = reports['free']
    assert level == OK, message
    assert message.startswith('nothing touches the tip')
    level, message, values = reports['pushed']
    assert level == WARN, message
    assert float(values['at least [N]']) > 0.0
    lever = tip_lever([0.0], shipped_rig().instrument.section_length)
    found = np.array([f.wrench.force.y for f in forces[free:]])
    assert found.max() == pytest.approx(MOMENT_NM / lever, rel=0.25)
    assert abs(np.array([f.wrench.force.y for f in forces[:free]])).max() < 0.5 * found.max()


def test_a_force_has_the_frame_of_the_tip_and_none_along_its_axis(pushed):
    _, forces, _, _ = pushed
    assert {f.header.frame_id for f in forces} == {'endoscope_tip'}
    assert all(math.isnan(f.wrench.force.z) for f in forces)
    stamps = np.array([f.header.stamp.sec + 1e-9 * f.header.stamp.nanosec for f in forces])
    assert np.diff(stamps) == pytest.approx(0.025, abs=1e-6)

"""The force at the tip in the real graph: bounds from a calibration, then something pushes.

The compensator yields to it.
"""

import math
from itertools import pairwise

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from simulated_graph import SimulatedGraph

from endoscope_core.kinematics import tip_lever
from endoscope_core.physics import EffectSpec, PlantDescription, save_plant
from endoscope_core.rig import shipped_rig
from endoscope_nodes.names import BOUNDS, MOTOR_COMMAND, MOTORS, TIP_FORCE, TIP_FORCE_BOUNDS
from endoscope_nodes.nodes.tip_force import TipForceNode
from endoscope_nodes.runtime.diagnostics import OK, WARN
from endoscope_nodes.runtime.qos import SENSOR_ASKED

PUSHED_AT_S, MOMENT_NM = 24.0, 0.003
"""After the plant began, with the first tick of the clock."""
CLOCK_START_S = 1.0
GUARD = 'compensator: guard'


@pytest.fixture(scope='module')
def pushed(tmp_path_factory):
    """The graph once something has pushed for a second; forces, and reports before and then.

    And what the compensator has heard and sent.
    """
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
        heard, sent = graph.listen(TIP_FORCE_BOUNDS, BOUNDS), graph.listen(MOTOR_COMMAND, MOTORS)
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
        forces = list(forces)
        # The motion turns against what pushes.
        graph.advance(2.0)
        yield graph, forces, free, reports, heard, sent


def _report(graph):
    graph.advance(1.1)
    return [
        (status.level, status.message, {v.key: v.value for v in status.values})
        for status in (graph.diagnostics[name][-1] for name in ('tip_force: force', GUARD))
    ]


def test_before_a_calibration_there_is_no_force_and_it_says_why(pushed):
    reports = pushed[3]
    level, message, _ = reports['first'][0]
    assert level == OK
    assert message.startswith('no force: ')


def test_free_motion_is_quiet_and_what_pushes_is_measured(pushed):
    _, forces, free, reports, _, _ = pushed
    level, message, _ = reports['free'][0]
    assert level == OK, message
    assert message.startswith('nothing touches the tip')
    level, message, values = reports['pushed'][0]
    assert level == WARN, message
    assert float(values['at least [N]']) > 0.0
    lever = tip_lever([0.0], shipped_rig().instrument.section_length)
    found = np.array([f.wrench.force.y for f in forces[free:]])
    assert found.max() == pytest.approx(MOMENT_NM / lever, rel=0.25)
    assert abs(np.array([f.wrench.force.y for f in forces[:free]])).max() < 0.5 * found.max()


def test_a_force_has_the_frame_of_the_tip_and_none_along_its_axis(pushed):
    forces = pushed[1]
    assert {f.header.frame_id for f in forces} == {'endoscope_tip'}
    assert all(math.isnan(f.wrench.force.z) for f in forces)
    stamps = np.array([f.header.stamp.sec + 1e-9 * f.header.stamp.nanosec for f in forces])
    assert np.diff(stamps) == pytest.approx(0.025, abs=1e-6)


def test_the_guard_is_off_then_watches_then_yields_and_reports_it_at_once(pushed):
    _, _, _, reports, heard, _ = pushed
    assert reports['first'][1][:2] == (OK, 'off: no force is known')
    assert reports['free'][1][:2] == (OK, 'watching')
    level, message, values = reports['pushed'][1]
    assert level == WARN
    assert message.startswith('yielding: bend_y pushes with 0.')
    assert message.endswith(' N (limit 0.10 N): towards the contact only at 0.1 mm/s')
    assert (values['state'], values['joints'], values['limit [N]']) == ('yielding', 'bend_y', '0.1')
    felt = dict(zip(BOUNDS, zip(*(s.effort for s in heard), strict=True), strict=True))
    above = [y > 0.1 and low > 0.0 for y, low in zip(felt['force_y'], felt['low_y'], strict=True)]
    second = 1 + next(k for k, both in enumerate(pairwise(above)) if all(both))
    # An estimate is 0.1 s late.
    assert float(values['since']) == pytest.approx(1e-9 * heard[second].stamp_ns + 0.1, abs=0.05)


def test_the_joint_that_is_pushed_stays_behind_and_the_other_follows(pushed):
    sent = pushed[5]
    gear = shipped_rig().joints.gear
    # The motion asks both joints for the same, first with what pushes and then against it.
    since_ns = 1e9 * (CLOCK_START_S + PUSHED_AT_S)
    x, y = np.array([s.position for s in sent if s.stamp_ns >= since_ns]).T / gear
    highest = int(y.argmax())
    # A joint may turn back a tick after the other, and in friction goes steeply then.
    assert y[highest] == pytest.approx(x.max(), abs=0.01)
    assert y[highest] - y[0] > 2.0
    assert x[highest] - x[-1] > 2.0
    assert y[-1] - x[-1] > 0.8

"""Calibration through the whole graph, and what makes it abort."""

import dataclasses
import math

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from simulated_graph import TICK_RATE, SimulatedGraph
from tubes import slave_of, tube_of_size

from endoscope_core.identification.law_choice import CalibrationFindings
from endoscope_core.physics import EffectSpec, PlantDescription
from endoscope_core.rig import load_rig
from endoscope_lab.dataset.rig_variation import backlash_sizes
from endoscope_nodes.names import CALIBRATION_FEEDBACK, CALIBRATION_NUMBERS
from endoscope_nodes.runtime.qos import RESULT, profile
from endoscope_nodes.topics import Qos


def assert_same_figures(numbers, values):
    """One message of numbers that are those of the result."""
    [message] = numbers
    told = dict(zip(message.name, message.position, strict=True))
    assert told['success'] == 1.0
    assert math.degrees(told['class']) == pytest.approx(float(values['class_deg']))
    alike = {'probability', 'backlash_size', 'duration', 'reach.bend_x.low', 'reach.bend_y.high'}
    alike |= {'regressed_size', 'regressed_size_low', 'regressed_size_high'}
    alike |= {key for key in values if key.startswith('probability_')}
    for key in (*alike, 'bend_x.capstan_exponent'):
        assert told[key] == float(values[key]), key


@pytest.mark.parametrize(
    ('size_deg', 'seed', 'motion', 'longest_s'),
    [
        pytest.param(50, 901, 'sinusoid', 11.0, marks=pytest.mark.nightly),
        (80, 902, 'brief', 5.0),
    ],
)
def test_finds_the_class_of_a_known_tube_from_anywhere(tmp_path, size_deg, seed, motion, longest_s):
    overrides = tube_of_size(tmp_path, size_deg, seed) | {'calibration': {'motion': motion}}
    with SimulatedGraph(overrides=overrides) as graph:
        numbers = []
        graph.probe.create_subscription(JointState, CALIBRATION_NUMBERS, numbers.append, RESULT)
        graph.connect()
        graph.enable()
        values = graph.calibrate()
        assert_same_figures(numbers, values)
        assert float(values['class_deg']) == size_deg
        probabilities = [float(v) for k, v in values.items() if k.startswith('probability_')]
        assert len(probabilities) == 7
        assert sum(probabilities) == pytest.approx(1.0, abs=1e-6)
        assert float(values['probability']) == max(probabilities)
        assert float(values['backlash_size_deg']) == pytest.approx(size_deg, abs=3.0)
        assert float(values['duration']) < longest_s
        assert values['backlash_size_from'] == {'sinusoid': 'tracker', 'brief': 'cnn'}[motion]
        low, high = float(values['regressed_size_low']), float(values['regressed_size_high'])
        assert low < float(values['regressed_size']) < high
        assert math.degrees(float(values['regressed_size'])) == pytest.approx(size_deg, abs=3.0)
        state = graph.nodes['compensator'].law
        assert state.findings.class_deg == size_deg
        if motion != 'brief':
            return
        graph.set('master', source='motion', motion='non_periodic')
        graph.advance(4.3)
        moved = graph.calibrate()
        assert moved['class_deg'] == values['class_deg']
        sizes = [math.degrees(float(v['regressed_size'])) for v in (values, moved)]
        assert sizes[0] == pytest.approx(sizes[1], abs=0.8)


def test_tensions_of_no_known_tube_are_refused_and_nothing_is_compensated(tmp_path):
    slack = EffectSpec('wire_slack', 'bend_y', {'length_m': 0.004})
    overrides = slave_of(PlantDescription(effects=(slack,)), tmp_path / 'slack.yaml')
    overrides['calibration'] = {'motion': 'brief'}
    with SimulatedGraph(overrides=overrides) as graph:
        graph.nodes['compensator'].law.findings = CalibrationFindings(60)
        graph.enable()
        assert graph.call_calibration().success
        graph.advance(5.0)
        status = graph.results[-1].status[0]
        assert status.level == b'\x02'
        values = {v.key: v.value for v in status.values}
        assert values['class_deg'] == 'none'
        assert values['reason'].startswith('none of the classes: the tensions')
        assert graph.nodes['compensator'].law.findings is None
        assert graph.states[-1] == 'ENABLED'


@pytest.mark.nightly
def test_wires_that_lost_pretension_are_told_with_the_class_by_the_plant(tmp_path):
    plant = PlantDescription()
    joints = {k: dataclasses.replace(j, pretension=3.54) for k, j in plant.joints.items()}
    plant = dataclasses.replace(plant, joints=joints)
    overrides = slave_of(plant, tmp_path / 'loose.yaml')
    overrides['calibration'] = {'motion': 'brief'}
    with SimulatedGraph(overrides=overrides) as graph:
        graph.enable()
        values = graph.calibrate()
        true = math.degrees(np.mean(backlash_sizes(plant)))
        assert values['backlash_size_from'] == 'plant'
        assert float(values['backlash_size_deg']) == pytest.approx(true, abs=2.0)
        assert abs(float(values['class_deg']) - true) < 6.0
        assert float(values['pretension_lost.bend_y']) == pytest.approx(0.9, abs=0.1)
        told = graph.results[-1].status[0].message
        assert 'lost pretension (bend_x 0.9 N, bend_y 0.9 N): tighten them' in told


def test_a_zero_that_is_off_is_told_with_the_class_or_the_refusal(tmp_path):
    bias = EffectSpec('load_cell_bias', 'bend_x', {'bias_n': 0.6, 'wire': 1.0})
    overrides = slave_of(PlantDescription(effects=(bias,)), tmp_path / 'bias.yaml')
    overrides['calibration'] = {'motion': 'brief'}
    with SimulatedGraph(overrides=overrides) as graph:
        graph.enable()
        assert graph.call_calibration().success
        graph.advance(5.0)
        status = graph.results[-1].status[0]
        values = {v.key: v.value for v in status.values}
        found = float(values['zero_error.wire_x_neg'])
        assert found == pytest.approx(0.6, abs=0.05)
        assert abs(float(values['zero_error.wire_x_pos'])) < 0.05
        told = f'zero of a load cell is off: wire_x_neg by +{found:.2g} N'
        assert told in status.message
        assert 'wire_y' not in status.message


def abort_reason(graph):
    status = graph.results[-1].status[0]
    assert status.level == b'\x02', status.message
    return {v.key: v.value for v in status.values}['reason']


def test_stale_load_cells_abort_and_the_slave_stands_still():
    with SimulatedGraph(
        overrides={'simulation_clock': {'wait_for': ['motor/measured_js']}}
    ) as graph:
        graph.enable()
        assert graph.call_calibration().success
        graph.advance(3.0)
        shafts = graph.listen('motor/measured_js', ('motor_x', 'motor_y'))
        graph.set('load_cells', connected=False)
        graph.advance(1.0)
        assert 'wires/measured_js has been silent' in f'{abort_reason(graph)} {graph.cause}'
        positions = np.array([s.position for s in shafts])
        assert np.ptp(positions[-TICK_RATE // 2 :], axis=0).max() < 0.003
        assert graph.states[-1] == 'FAULT'
        assert graph.nodes['compensator'].law.findings is None


def test_over_tension_aborts_and_is_a_fault():
    rig = load_rig()
    low = dataclasses.replace(rig.tension, ceiling=8.0, calibration_ceiling=7.8)
    with SimulatedGraph(rig=dataclasses.replace(rig, tension=low)) as graph:
        graph.enable()
        assert graph.call_calibration().success
        graph.advance(4.0)
        assert 'over the ceiling of 7.8 N' in abort_reason(graph)
        assert 'wire_' in abort_reason(graph)
        assert graph.states[-1] == 'FAULT'
        assert not graph.nodes['calibration'].active


def test_feedback_says_by_codes_how_orders_fare():
    with SimulatedGraph(overrides={'calibration': {'motion': 'brief'}}) as graph:
        said = []
        all_of_it = profile(Qos(1000, latched=True))
        graph.probe.create_subscription(
            DiagnosticArray, CALIBRATION_FEEDBACK, said.append, all_of_it
        )
        graph.connect()

        def told_to_the_end():
            graph.wait(lambda: said and orders()[-1]['state'] != 'executing')
            found = orders()
            said.clear()
            return found

        def orders():
            assert {message.status[0].name for message in said} == {'calibration: order'}
            return [{i.key: i.value for i in message.status[0].values} for message in said]

        graph.advance(0.05)
        [waiting] = told_to_the_end()
        assert (waiting['order'], waiting['id'], waiting['state']) == ('', '0', 'waiting')
        assert not graph.call_calibration().success
        [rejected] = told_to_the_end()
        assert (rejected['state'], rejected['code']) == ('rejected', 'no_session')
        graph.enable()
        graph.calibrate()
        told = told_to_the_end()
        assert {o['order'] for o in told} == {'calibrate'}
        assert len({o['id'] for o in told}) == 1
        assert [o['state'] for o in told] == ['executing'] * (len(told) - 1) + ['succeeded']
        phases = list(dict.fromkeys(o['phase'] for o in told[:-1]))
        assert phases[:3] == ['returning', 'resting', 'moving']
        progress = [float(o['progress']) for o in told]
        assert progress == sorted(progress)
        assert progress[-1] == 1.0
        assert len(told) > 20
        graph.command('home')
        graph.advance(0.2)
        graph.command('pause')
        graph.advance(0.2)
        last = told_to_the_end()[-1]
        assert (last['order'], last['state'], last['code']) == ('home', 'aborted', 'session_ended')
        # In one instant of simulated time.
        for _ in range(2):
            answer = graph.call_calibration()
            assert not answer.success
            assert 'no motion session is open' in answer.message
        graph.wait(lambda: len(said) == 2)
        assert len({order['id'] for order in orders()}) == 2

"""A tube lets the tip be bent only so far: calibration finds it, and what asks for more is cut."""

import dataclasses

import numpy as np
import pytest
from commanded_graph import Sender
from simulated_graph import TICK_RATE, SimulatedGraph
from tubes import slave_of, tube_of_size

from endoscope_core.control import MotorLimits, bending_range
from endoscope_core.identification.law_choice import CalibrationFindings
from endoscope_core.physics import load_plant
from endoscope_core.rig import shipped_rig
from endoscope_core.safety import BendingRange
from endoscope_nodes.names import (
    CALIBRATION_COMMAND,
    JOINTS,
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    MOTORS,
    SLAVE_COMMAND,
)
from endoscope_nodes.runtime.diagnostics import WARN


def rig_of(**joints):
    """The shipped rig with other bounds of its joints, in rad."""
    rig = shipped_rig()
    return dataclasses.replace(rig, joints=dataclasses.replace(rig.joints, **joints))


def warnings(graph, name):
    return [told.message for told in graph.diagnostics[name] if told.level == WARN]


def test_a_calibration_finds_the_reach_and_the_master_keeps_to_it(tmp_path):
    """In a tube so tight that 60 deg are more than it allows, by motors that turn less far.

    Their gear is another than the shipped rig's, by smaller pulleys.
    """
    overrides = tube_of_size(tmp_path, 80, 1080)
    plant = load_plant(overrides['motor_driver']['plant_file'])
    rig = rig_of(drive=1.9, gear=0.6)
    share = shipped_rig().joints.gear / rig.joints.gear
    joints = {
        name: dataclasses.replace(joint, pulley_radius=share * joint.pulley_radius)
        for name, joint in plant.joints.items()
    }
    plant = dataclasses.replace(plant, joints=joints)
    overrides = slave_of(plant, tmp_path / 'geared.yaml') | {'calibration': {'motion': 'brief'}}
    with SimulatedGraph(overrides=overrides, rig=rig) as graph:
        graph.enable()
        values = graph.calibrate()
        assert values['class_deg'] == '80'
        found = [
            [float(values[f'reach.{joint}.{end}']) for end in ('low', 'high')] for joint in JOINTS
        ]
        limits = MotorLimits.of(rig)
        tubes = [bending_range(joint, limits) for joint in plant.joints.values()]
        true = [(tube.low, tube.high) for tube in tubes]
        np.testing.assert_allclose(np.degrees(found), np.degrees(true), atol=5.0)
        commands = graph.listen(SLAVE_COMMAND)
        graph.set('master', source='motion')
        graph.advance(4.0)
        asked = np.max([c.position for c in commands], axis=0)
        # The master brakes as the acceleration allows; the compensator cuts the way of braking.
        np.testing.assert_allclose(asked, [high for _, high in found], atol=0.03)
        assert 'this tube can be bent: bend_x from ' in warnings(graph, 'master: commands')[-1]


def test_the_compensator_cuts_what_a_master_asks_for_beyond_it():
    overrides = {'compensator': {'mode': 'none'}, 'controller': {'active': False}}
    with SimulatedGraph(overrides=overrides) as graph:
        gear = graph.nodes['compensator'].rig.joints.gear
        graph.enable()
        graph.nodes['compensator'].law.findings = CalibrationFindings(
            ranges=(BendingRange(-0.2, 0.3),) * 2
        )
        asked, drives = graph.listen(SLAVE_COMMAND), graph.listen(MOTOR_COMMAND, MOTORS)
        graph.set('master', source='motion')
        graph.advance(2.5)
        assert max(a.position[0] for a in asked) > 0.8
        assert max(d.position[0] for d in drives) == pytest.approx(0.3 * gear, abs=2e-3)
        said = warnings(graph, 'compensator: output')[-1]
        assert 'bend_y from -11 to 17 deg, more was asked for' in said
        assert int(graph.reported('compensator: output')['cut to the reach']) > TICK_RATE


def test_a_calibration_that_needs_more_than_the_reach_is_refused_and_nothing_moves():
    with SimulatedGraph(rig=rig_of(reach=1.2)) as graph:
        graph.enable()
        goals = graph.listen(MOTOR_COMMAND, MOTORS)
        answer = graph.call_calibration()
        assert not answer.success
        assert 'every joint 1.571 rad either way, beyond joints.reach 1.2' in answer.message
        assert '`endoscope operate set compensator.mode none`' in answer.message
        graph.advance(3.0)
        assert goals == []
        assert graph.state == 'ENABLED'


def test_nothing_that_a_calibration_commands_leads_beyond_the_reach():
    """Whoever commands it: the compensator has a gate of its own."""
    with SimulatedGraph(rig=rig_of(reach=0.3), without=['calibration']) as graph:
        compensator, gear = graph.nodes['compensator'], shipped_rig().joints.gear
        graph.enable()
        sender = Sender(graph, CALIBRATION_COMMAND)
        goals = graph.listen(MOTOR_COMMAND, MOTORS)
        for k in range(TICK_RATE):
            sender.send([0.5 * k / TICK_RATE, 0.0], velocity=[0.5, 0.0])
            graph.advance(1.0 / TICK_RATE)
        assert max(goal.position[0] for goal in goals) == pytest.approx(0.3 * gear, abs=2e-3)
        assert compensator.stream.calibration_gate.last_reason.endswith('rad beyond 0.3')


def test_home_leads_back_from_shafts_beyond_the_reach():
    """Compensation turns them further than the reach of the joint, up to the drive."""
    with SimulatedGraph(
        rig=rig_of(reach=0.6), overrides={'controller': {'active': False}}
    ) as graph:
        compensator, gear = graph.nodes['compensator'], shipped_rig().joints.gear
        graph.enable()
        compensator.law.findings = CalibrationFindings(class_deg=100)
        graph.set('compensator', mode='dahl')
        graph.set('master', source='motion')
        graph.advance(2.0)
        graph.set('master', source='none')
        graph.advance(0.3)
        shafts = graph.listen(MOTOR_MEASURED, MOTORS)
        graph.advance(0.02)
        assert max(map(abs, shafts[-1].position)) > 0.7 * gear
        shafts.clear()
        graph.command('home')
        graph.advance(3.0)
        assert graph.reported('calibration: procedure')['last'].startswith('home reached')
        turned = np.abs([sample.position for sample in shafts])
        assert turned.max() < turned[0].max() + 0.01
        assert sum(compensator.stream.calibration_gate.refused.values()) == 0

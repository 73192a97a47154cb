"""`endoscope identify` with every model, the plant, and the table that grows."""

import json

import numpy as np
import pytest

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bringup.cli import main
from endoscope_core.control import PhysicalParameters
from endoscope_core.hysteresis import BoucWenParameters, forward
from endoscope_core.identification import Servo, UpdatedTable
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.physics import JointParameters, PlantDescription, simulate
from endoscope_core.rig import load_rig
from endoscope_core.signals import motion_by_name

START = 1_700_000_000_000_000_000


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """A calibration of the nominal rig, one joint, all that its sensors say."""
    plant = PlantDescription()
    angle, _ = motion_by_name('calibration').sample(np.arange(0.0, 9.0, 1e-3))
    made = simulate(plant, 0.5 * angle)
    stamps = START + np.arange(len(angle)) * 1_000_000
    folder = tmp_path_factory.mktemp('calibration') / 'bag'
    wires = ['wire_x_pos', 'wire_x_neg']
    streams = [
        ('motor/servo_jp', ['motor_x'], stamps, {'position': 0.5 * angle[:, :1]}),
        ('motor/measured_js', ['motor_x'], stamps, {'position': made.shaft_position[:, :1]}),
        ('wires/measured_js', wires, stamps, {'effort': made.tension[:, 0]}),
        ('slave/measured_js', ['bend_x'], stamps[::25], {'position': made.bending[::25, :1]}),
    ]
    with BagWriter(folder) as writer:
        writer.write_streams(
            [
                MessageStream(
                    f'/rig/{topic}',
                    JOINT_STATE,
                    encode_joint_states(names, at, **values),
                    at + 7,
                    at + 5,
                )
                for topic, names, at, values in streams
            ]
        )
    return folder


def test_the_plant_is_identified_from_a_bag(bag, capsys):
    assert main(['identify', str(bag), '--model', 'physical']) == 0
    found = json.loads(capsys.readouterr().out)['joints']['bend_x']
    plant = PhysicalParameters.from_dict(found['model'])
    assert plant.joint.capstan_exponent == pytest.approx(0.9, rel=0.03)
    assert found['tension_rmse'] < 0.02


def test_each_calibration_extends_the_table(bag, tmp_path, capsys):
    table = tmp_path / 'table.json'
    source = ['identify', str(bag), '--model', 'dahl', '--table', str(table)]
    assert main(source) == 0
    assert main(source) == 0
    assert '1 entries' in capsys.readouterr().err
    entries = UpdatedTable.load(table).entries
    assert len(entries) == 1
    assert np.rad2deg(entries[0].size) == pytest.approx(69.0, abs=4.0)
    assert main(['identify', str(bag), '--model', 'bouc_wen', '--table', str(table)]) == 2
    assert 'is a table of dahl' in capsys.readouterr().err


def test_a_table_holds_no_plants(bag, tmp_path, capsys):
    command = ['identify', str(bag), '--model', 'physical', '--table', str(tmp_path / 't.json')]
    assert main(command) == 2
    assert '--table' in capsys.readouterr().err


@pytest.fixture(scope='module')
def calibration():
    """Stamps, desired angle and the answer of a rig whose loop Bouc-Wen's equation can have."""
    angle, _ = motion_by_name('calibration').sample(np.arange(0.0, 10.0, 1e-3))
    # Friction that grows with the bend is no part of that.
    plant = PlantDescription({'bend_x': JointParameters(), 'bend_y': JointParameters()})
    trajectory = simulate(plant, angle * load_rig().joints.gear)
    stamps = 1_700_000_000_000_000_000 + np.arange(0, 10_000) * 1_000_000
    return stamps, angle, trajectory


def write_bag(folder, streams):
    with BagWriter(folder) as writer:
        writer.write_streams(
            [
                MessageStream(
                    topic,
                    JOINT_STATE,
                    encode_joint_states(names, stamps, position=values),
                    stamps + 7,
                    stamps + 5,
                )
                for topic, names, stamps, values in streams
            ]
        )
    return folder


@pytest.mark.parametrize('driver', ['motor/measured_js', 'motor/servo_jp', 'slave/servo_jp'])
def test_identifying_a_bag_finds_the_width_of_its_loop(calibration, tmp_path, driver, capsys):
    stamps, angle, trajectory = calibration
    bending = trajectory.bending[::25, :1]
    names = ['bend_x'] if driver.startswith('slave') else ['motor_x']
    values = {
        'motor/measured_js': trajectory.shaft_position[:, :1],
        'motor/servo_jp': 0.5 * angle[:, :1],
        'slave/servo_jp': angle[:, :1],
    }[driver]
    bag = write_bag(
        tmp_path / 'bag',
        [
            (f'/rig/{driver}', names, stamps, values),
            ('/rig/slave/measured_js', ['bend_x'], stamps[::25], bending),
        ],
    )
    assert main(['identify', str(bag), '--model', 'bouc_wen']) == 0
    found = json.loads(capsys.readouterr().out)['joints']
    assert list(found) == ['bend_x']
    model = BoucWenParameters.from_dict(found['bend_x']['model'])
    settled = slice(2717, 9000)
    width = width_at_mid_height(angle[settled, 0], trajectory.bending[settled, 0])
    modelled = forward(model, Servo().answer(angle[:, 0], 1e-3))
    assert width_at_mid_height(angle[settled, 0], modelled[settled]) == pytest.approx(
        width, abs=np.deg2rad(2.0)
    )
    assert found['bend_x']['model_rmse'] < np.deg2rad(1.5)


def test_a_bag_that_does_not_say_what_the_motors_did_is_refused(calibration, tmp_path, capsys):
    stamps, _, trajectory = calibration
    bag = write_bag(
        tmp_path / 'bag',
        [('/rig/slave/measured_js', ['bend_x'], stamps[::25], trajectory.bending[::25, :1])],
    )
    assert main(['identify', str(bag), '--model', 'bouc_wen']) == 2
    error = capsys.readouterr().err
    assert 'motor/measured_js' in error
    assert error.count('\n') == 1


@pytest.mark.parametrize(
    'words', [['nowhere', '--model', 'bouc_wen'], ['nowhere', '--model', 'unheard_of'], ['nowhere']]
)
def test_wrong_usage_is_one_line_and_exit_2(words, capsys):
    try:
        status = main(['identify', *words])
    except SystemExit as leaving:
        status = leaving.code
    assert status == 2
    assert capsys.readouterr().err.count('\n') == 1

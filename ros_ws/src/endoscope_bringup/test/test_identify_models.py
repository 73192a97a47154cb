"""`endoscope identify` with every model, the plant, and the table that grows."""

import json

import numpy as np
import pytest

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bringup.cli import main
from endoscope_core.control import PhysicalParameters
from endoscope_core.hysteresis import BoucWenParameters, forward
from endoscope_core.identification import Servo, UpdatedTable
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.physics import JointParameters, PlantDescription, simulate
from endoscope_core.rig import load_rig
from endoscope_core.signals import motion_by_name

STAMPS = 1_700_000_000_000_000_000 + np.arange(10_000) * 1_000_000


def calibration_of(plant):
    """Desired angle and the answer of a joint."""
    angle, _ = motion_by_name('calibration').sample(np.arange(0.0, 10.0, 1e-3))
    return angle[:, :1], simulate(plant, angle[:, :1] * load_rig().joints.gear)


@pytest.fixture(scope='module')
def calibration():
    # Friction that grows with the bend is no part of Bouc-Wen's equation.
    return calibration_of(PlantDescription({'bend_x': JointParameters()}))


def write_bag(folder, *streams):
    """Write streams of a topic, its names, the samples between two of them, and its values."""
    with BagWriter(folder) as writer:
        for topic, names, every, values in streams:
            at = STAMPS[::every]
            cdr = encode_joint_states(names, at, **{k: v[::every] for k, v in values.items()})
            writer.write_streams([MessageStream(f'/rig/{topic}', JOINT_STATE, cdr, at + 7, at + 5)])
    return folder


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """A calibration of the nominal rig, with all that its sensors say."""
    angle, made = calibration_of(PlantDescription().of_joints(['bend_x']))
    return write_bag(
        tmp_path_factory.mktemp('calibration') / 'bag',
        ('motor/servo_jp', ['motor_x'], 1, {'position': 0.5 * angle}),
        ('motor/measured_js', ['motor_x'], 1, {'position': made.shaft_position}),
        ('wires/measured_js', ['wire_x_pos', 'wire_x_neg'], 1, {'effort': made.tension[:, 0]}),
        ('slave/measured_js', ['bend_x'], 25, {'position': made.bending}),
    )


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


@pytest.mark.parametrize(
    'driver',
    [
        'motor/servo_jp',
        *(
            pytest.param(driver, marks=pytest.mark.nightly)
            for driver in ('motor/measured_js', 'slave/servo_jp')
        ),
    ],
)
def test_identifying_a_bag_finds_the_width_of_its_loop(calibration, tmp_path, driver, capsys):
    angle, made = calibration
    names = ['bend_x'] if driver.startswith('slave') else ['motor_x']
    values = {'motor/measured_js': made.shaft_position, 'motor/servo_jp': 0.5 * angle}
    bag = write_bag(
        tmp_path / 'bag',
        (driver, names, 1, {'position': values.get(driver, angle)}),
        ('slave/measured_js', ['bend_x'], 25, {'position': made.bending}),
    )
    assert main(['identify', str(bag), '--model', 'bouc_wen']) == 0
    found = json.loads(capsys.readouterr().out)['joints']
    assert list(found) == ['bend_x']
    model = BoucWenParameters.from_dict(found['bend_x']['model'])
    settled = slice(2717, 9000)
    width = width_at_mid_height(angle[settled, 0], made.bending[settled, 0])
    modelled = forward(model, Servo().answer(angle[:, 0], 1e-3))
    assert width_at_mid_height(angle[settled, 0], modelled[settled]) == pytest.approx(
        width, abs=np.deg2rad(2.0)
    )
    assert found['bend_x']['model_rmse'] < np.deg2rad(1.5)


def test_a_bag_that_does_not_say_what_the_motors_did_is_refused(calibration, tmp_path, capsys):
    bending = {'position': calibration[1].bending}
    bag = write_bag(tmp_path / 'bag', ('slave/measured_js', ['bend_x'], 25, bending))
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

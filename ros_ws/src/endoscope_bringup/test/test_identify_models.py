"""`endoscope identify` with every model, the plant, and the table that grows."""

import json

import numpy as np
import pytest

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bringup.cli import main
from endoscope_core.control import PhysicalParameters
from endoscope_core.identification import UpdatedTable
from endoscope_core.physics import PlantDescription, simulate
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
    assert np.rad2deg(entries[0].size) == pytest.approx(74.0, abs=4.0)
    assert main(['identify', str(bag), '--model', 'bouc_wen', '--table', str(table)]) == 2
    assert 'is a table of dahl' in capsys.readouterr().err


def test_a_table_holds_no_plants(bag, tmp_path, capsys):
    command = ['identify', str(bag), '--model', 'physical', '--table', str(tmp_path / 't.json')]
    assert main(command) == 2
    assert '--table' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('arguments', 'said'),
    [
        (['family', 'FOLDER'], 'no recordings of tubes'),
        (['somewhere', 'FOLDER'], 'identify family FOLDER'),
        (['family', 'FOLDER', '--model', 'dahl'], 'no model'),
        (['FOLDER'], 'no --model'),
        (['FOLDER', '--model', 'dahl', '--output', 'x.yaml'], '--output and --figure'),
    ],
)
def test_a_rig_is_not_identified_from_what_is_no_tube(arguments, said, tmp_path, capsys):
    given = [str(tmp_path) if each == 'FOLDER' else each for each in arguments]
    assert main(['identify', *given]) != 0
    assert said in capsys.readouterr().err

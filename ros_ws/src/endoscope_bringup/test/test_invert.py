"""`endoscope invert` on what the master plays: a file, and the desired angles of a bag."""

import numpy as np
import pytest

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bringup.cli import main
from endoscope_core.physics import JointParameters, PlantDescription, save_plant, simulate
from endoscope_core.rig import load_rig
from endoscope_core.signals.command_file import read_command_file, write_command_file

TIME = np.arange(0.0, 3.0, 0.01)
ANGLE = 0.2 + 0.3 * np.sin(2.0 * TIME)[:, None]


@pytest.fixture
def motion(request, tmp_path):
    if request.param == 'file':
        write_command_file(tmp_path / 'motion.csv', TIME, ANGLE, ['bend_x'])
        return tmp_path / 'motion.csv'
    stamps = (TIME * 1e9).round().astype(np.int64) + 10**18
    payloads = encode_joint_states(['bend_x'], stamps, position=ANGLE)
    with BagWriter(tmp_path / 'bag') as bag:
        bag.write_streams([MessageStream('/rig/slave/servo_jp', JOINT_STATE, payloads, stamps)])
    return tmp_path / 'bag'


@pytest.mark.parametrize('motion', ['file', 'bag'], indirect=True)
def test_a_motion_of_ones_own_is_planned_and_the_plant_follows_it(motion, tmp_path, capsys):
    plant = PlantDescription(joints={'bend_x': JointParameters()})
    save_plant(plant, tmp_path / 'plant.yaml')
    out = tmp_path / 'command.csv'
    argv = ['--plant', str(tmp_path / 'plant.yaml'), '--motion', str(motion), '--out', str(out)]
    assert main(['invert', *argv]) == 0, capsys.readouterr().err
    planned = read_command_file(out, ['bend_x'])
    tip = simulate(plant, load_rig().joints.gear * planned.angle).bending_true[:, 0]
    wanted = np.interp(planned.time, 2.0 + TIME, ANGLE[:, 0])
    played = planned.time >= 2.5
    assert np.rad2deg(np.sqrt(np.mean((tip - wanted)[played] ** 2))) < 0.5


def test_a_motion_that_is_neither_known_nor_a_file_is_one_line(tmp_path, capsys):
    save_plant(PlantDescription(), tmp_path / 'plant.yaml')
    argv = ['--plant', str(tmp_path / 'plant.yaml'), '--motion', 'peridic', '--out', 'command.csv']
    assert main(['invert', *argv]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "no motion and no file 'peridic'" in line
    assert 'did you mean periodic?' in line

"""`endoscope simulate`: same topics, same stamps, the plant's answer."""

import re
from hashlib import sha256

import numpy as np
import pytest

from endoscope_bags import BagWriter, MessageStream, open_bag
from endoscope_bags.cdr import encode_joint_states, encode_poses
from endoscope_bags.message_types import JOINT_STATE, POSE_STAMPED
from endoscope_bags.recording import kind_of_bag
from endoscope_bringup.cli import main
from endoscope_core.kinematics import bending_from_orientation, tip_pose
from endoscope_core.physics import PlantDescription, SensorModel, save_plant, simulate
from endoscope_core.rig import Kind

TICKS = 1200
STAMPS = 1_700_000_000_000_000_000 + np.arange(TICKS) * 1_000_000
SHAFT = np.column_stack(
    [0.3 * np.sin(0.004 * np.arange(TICKS)), 0.2 * np.sin(0.003 * np.arange(TICKS))]
)


def stream(topic, names, stamps, **values):
    return MessageStream(
        topic, JOINT_STATE, encode_joint_states(names, stamps, **values), stamps + 7, stamps + 5
    )


def written(path, *streams):
    with BagWriter(path) as writer:
        writer.write_streams(list(streams))
    return path


@pytest.fixture
def plant_file(tmp_path):
    save_plant(PlantDescription(), tmp_path / 'plant.yaml')
    return tmp_path / 'plant.yaml'


@pytest.fixture
def recorded(tmp_path):
    tracked = STAMPS[::25]
    written(
        tmp_path / 'recorded',
        stream('/other/motor/servo_jp', ['motor_y', 'motor_x'], STAMPS, position=SHAFT[:, ::-1]),
        stream(
            '/other/slave/measured_js',
            ['bend_x', 'bend_y'],
            tracked,
            position=np.zeros((len(tracked), 2)),
        ),
    )
    return tmp_path / 'recorded'


def run(plant, commands, out, *more):
    return main(
        ['simulate', '--plant', str(plant), '--commands', str(commands), '--out', str(out), *more]
    )


def test_the_answer_has_the_topics_and_stamps_of_the_recording(recorded, plant_file, tmp_path):
    assert run(plant_file, recorded, tmp_path / 'answer') == 0
    answer = open_bag(tmp_path / 'answer')
    assert set(answer.topics) == {
        '/other/motor/servo_jp',
        '/other/slave/measured_js',
        '/other/motor/measured_js',
        '/other/wires/measured_js',
        '/other/rig/kind',
    }
    rig = kind_of_bag(answer)
    assert rig.kind is Kind.SIMULATED
    # A plant file's text, as it was written, is what the digest is of.
    assert rig.plant_sha256 == sha256(plant_file.read_bytes()).hexdigest()
    bending = answer.joint_state('slave/measured_js')
    np.testing.assert_array_equal(bending.stamp_ns, STAMPS[::25])
    np.testing.assert_array_equal(bending.log_ns, STAMPS[::25] + 7)
    expected = simulate(PlantDescription(), SHAFT)
    np.testing.assert_allclose(bending.position, expected.bending[::25], atol=1e-9)
    wires = answer.joint_state('wires/measured_js')
    assert wires.names == ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg')
    np.testing.assert_allclose(wires.effort, expected.tension.reshape(TICKS, 4), atol=1e-9)


@pytest.mark.parametrize('motors', [['motor_x', 'motor_y'], ['motor_y']])
def test_recorded_poses_are_answered_by_those_of_the_answered_angles(plant_file, tmp_path, motors):
    tracked = STAMPS[::25]
    poses = [tip_pose((0.5, 0.001 * n), 0.03) for n in range(len(tracked))]
    columns = [['motor_x', 'motor_y'].index(motor) for motor in motors]
    written(
        tmp_path / 'poses',
        stream('/a/motor/servo_jp', motors, STAMPS, position=SHAFT[:, columns]),
        stream(
            '/a/slave/measured_js',
            ['bend_y'],
            tracked,
            position=np.zeros((len(tracked), 1)),
        ),
        MessageStream(
            '/a/tracker/measured_cp',
            POSE_STAMPED,
            encode_poses(tracked, *map(np.array, zip(*poses, strict=True)), frame_id='base'),
            tracked + 9,
            tracked + 5,
        ),
    )
    assert run(plant_file, tmp_path / 'poses', tmp_path / 'answer', '--noise', '1') == 0
    answer = open_bag(tmp_path / 'answer')
    pose, bending = answer.poses('tracker/measured_cp'), answer.joint_state('slave/measured_js')
    assert pose.topic == '/a/tracker/measured_cp'
    assert pose.frame_id == 'base'
    np.testing.assert_array_equal(pose.stamp_ns, tracked)
    np.testing.assert_array_equal(pose.log_ns, tracked + 9)
    angles = np.array([bending_from_orientation(q) for q in pose.orientation])
    np.testing.assert_allclose(angles[:, columns], bending.position, atol=1e-9)
    length_of_arc = [tip_pose(angle, 0.03)[0] for angle in angles]
    np.testing.assert_allclose(pose.position, length_of_arc, atol=1e-9)


def test_desired_angles_times_the_gear_stand_in_for_shaft_commands(plant_file, tmp_path):
    written(
        tmp_path / 'angles.mcap',
        stream('slave/servo_jp', ['bend_x'], STAMPS, position=SHAFT[:, :1] / 0.5),
    )
    assert run(plant_file, tmp_path / 'angles.mcap', tmp_path / 'answer.mcap') == 0
    answer = open_bag(tmp_path / 'answer.mcap')
    assert answer.joint_state('wires/measured_js').names == ('wire_x_pos', 'wire_x_neg')
    motor = answer.joint_state('motor/measured_js')
    expected = simulate(PlantDescription(), SHAFT)
    np.testing.assert_allclose(motor.position, expected.shaft_position[:, :1], atol=1e-9)


def test_noise_is_reproducible_and_as_large_as_the_sensors_say(recorded, plant_file, tmp_path):
    for name in ('a', 'b'):
        assert run(plant_file, recorded, tmp_path / name, '--noise', '3') == 0
    first, second = (open_bag(tmp_path / n).joint_state('wires/measured_js') for n in ('a', 'b'))
    np.testing.assert_array_equal(first.effort, second.effort)
    clean = simulate(PlantDescription(), SHAFT).tension.reshape(TICKS, 4)
    assert np.std(first.effort - clean) == pytest.approx(0.02, rel=0.05)
    assert SensorModel(PlantDescription().sensors, 3).tension(clean).shape == clean.shape


@pytest.mark.parametrize('late', [0, 1])
def test_the_answer_is_stamped_as_the_recording_stamps_its_readings(plant_file, tmp_path, late):
    truth = simulate(PlantDescription(), SHAFT)
    shaft = SensorModel(PlantDescription().sensors, 1).shaft_position(truth.shaft_position)
    written(
        tmp_path / 'recorded',
        stream('motor/servo_jp', ['motor_x', 'motor_y'], STAMPS, position=SHAFT),
        stream(
            'motor/measured_js',
            ['motor_x', 'motor_y'],
            STAMPS[: TICKS - late],
            position=shaft[late:],
        ),
    )
    assert run(plant_file, tmp_path / 'recorded', tmp_path / 'answer') == 0
    bending = open_bag(tmp_path / 'answer').joint_state('slave/measured_js')
    rows = np.arange(0, TICKS - 1, 25)
    np.testing.assert_allclose(bending.position[: len(rows)], truth.bending[rows + late], atol=1e-9)


BOTH = ['motor_x', 'motor_y']
BROKEN = np.where(np.arange(TICKS)[:, None] == 700, np.nan, SHAFT)
# As a driver leaves them that does not set the header.
UNSET = encode_joint_states(BOTH, np.zeros(TICKS, dtype=np.int64), position=SHAFT)


@pytest.mark.parametrize(
    ('commands', 'message'),
    [
        (stream('/x/wires/measured_js', ['w'], STAMPS, effort=SHAFT[:, :1]), 'motor/servo_jp'),
        (
            stream('/motor/servo_jp', BOTH, STAMPS, position=np.degrees(SHAFT)),
            r'the shaft of bend_x to 17\.19 rad, beyond the 1\.6 rad of the rig.*not in degrees',
        ),
        (stream('motor/servo_jp', BOTH, STAMPS, position=BROKEN), 'nan'),
        (
            MessageStream('/a/motor/servo_jp', JOINT_STATE, UNSET, STAMPS),
            r'all 1200 messages of /a/motor/servo_jp are stamped 0\.000 s.*must set the header',
        ),
    ],
    ids=['none', 'in degrees', 'not finite', 'without stamps'],
)
def test_commands_that_cannot_be_used_are_one_line_and_leave_nothing(
    plant_file, tmp_path, capsys, commands, message
):
    assert run(plant_file, written(tmp_path / 'commands', commands), tmp_path / 'answer') == 2
    [line] = capsys.readouterr().err.splitlines()
    assert re.search(message, line)
    assert sorted(p.name for p in tmp_path.iterdir()) == ['commands', 'plant.yaml']

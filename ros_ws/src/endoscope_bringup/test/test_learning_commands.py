"""`endoscope dataset`, `train` and `identify`, one after the other as a person uses them."""

import json
import subprocess
import sys

import numpy as np
import pytest

from endoscope_bags import BagWriter, MessageStream
from endoscope_bags.cdr_encoding import encode_joint_states
from endoscope_bags.message_types import JOINT_STATE
from endoscope_bringup.cli import main
from endoscope_core.classifier.inference import TensionClassifier
from endoscope_core.classifier.shipped import load_classifier
from endoscope_core.dataset import load_dataset
from endoscope_core.hysteresis import BoucWenParameters, bouc_wen_forward
from endoscope_core.identification import Servo, load_class_parameters
from endoscope_core.metrics import width_at_mid_height
from endoscope_core.physics import PlantDescription, simulate
from endoscope_core.rig import load_rig
from endoscope_core.signals import motion_by_name


@pytest.fixture(scope='module')
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp('learning') / 'data'
    assert main(['dataset', '--out', str(folder), '--seed', '5', '--n', '14']) == 0
    return folder


@pytest.fixture(scope='module')
def calibration():
    """Stamps, desired angle and the answer of the nominal rig to the calibration motion."""
    angle, _ = motion_by_name('calibration').sample(np.arange(0.0, 10.0, 1e-3))
    trajectory = simulate(PlantDescription(), angle * load_rig().joints.gear)
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


def test_the_data_set_says_how_it_was_made(data):
    dataset = load_dataset(data)
    assert (dataset.manifest['seed'], dataset.manifest['per_class']) == (5, 2)
    assert len(dataset.class_deg) == 14


def test_a_data_set_does_not_replace_what_is_there(data, capsys):
    assert main(['dataset', '--out', str(data)]) == 2
    assert 'is not empty' in capsys.readouterr().err


def test_training_leaves_weights_that_tell_sizes(data, tmp_path):
    out, plots = tmp_path / 'weights.safetensors', tmp_path / 'plots'
    options = ['--folds', '2', '--plots', str(plots)]
    assert main(['train', '--data', str(data), '--out', str(out), *options]) == 0
    for name, words in (('confusion', 'true class'), ('intervals', 'within their interval')):
        svg = (plots / f'{name}.svg').read_text()
        assert svg.startswith('<svg')
        assert words in svg
    described = json.loads(out.with_suffix('.json').read_text())
    assert '--motion sinusoid' in described['command']
    assert '--model size' in described['command']
    dataset = load_dataset(data)
    result = load_classifier(out).classify(dataset.tension[0])
    assert result.size == pytest.approx(dataset.backlash_size[0], abs=np.deg2rad(5.0))


@pytest.mark.parametrize(
    ('folds', 'words'),
    [
        ('1', '1 folds cannot be made of 2 recorded tubes a class: give 2 to 2 folds'),
        ('5', 'give 2 to 2 folds, or make more of them with `endoscope dataset --n`'),
        ('-3', 'give 2 to 2 folds'),
    ],
)
def test_folds_that_cannot_be_made_are_one_line(data, tmp_path, capsys, folds, words):
    out = tmp_path / 'weights.safetensors'
    assert main(['train', '--data', str(data), '--out', str(out), '--folds', folds]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert words in line
    assert not out.exists()


def test_one_recording_a_class_trains_nothing(tmp_path, capsys):
    folder, out = tmp_path / 'data', tmp_path / 'weights.safetensors'
    assert main(['dataset', '--out', str(folder), '--n', '7']) == 0
    assert main(['train', '--data', str(folder), '--out', str(out)]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert 'of 1 recorded tubes a class: at least 2 a class are needed' in line


def test_a_data_set_without_room_on_the_disk_is_named(tmp_path):
    program = f'{sys.executable} -m endoscope_bringup.cli dataset --n 7 --out data'
    done = subprocess.run(
        ['bash', '-c', f'ulimit -f 20; {program}'],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr == f'endoscope: {tmp_path / "data"}: File too large\n'
    assert list(tmp_path.iterdir()) == []


def test_training_the_papers_network_leaves_weights_that_classify(data, tmp_path):
    pytest.importorskip('torch', reason='PyTorch is missing: make -C ros_ws train')
    out = tmp_path / 'weights.safetensors'
    options = ['--model', 'cnn', '--folds', '2']
    assert main(['train', '--data', str(data), '--out', str(out), *options]) == 0
    described = json.loads(out.with_suffix('.json').read_text())
    assert described['command'].startswith('endoscope dataset --seed 5 --n 14')
    assert np.sum(described['held_out']['confusion']) == 14
    result = TensionClassifier.load(out).classify(load_dataset(data).tension[0])
    assert sum(result.probabilities.values()) == pytest.approx(1.0)


def test_without_pytorch_one_line_says_how_to_get_it(data, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, 'torch', None)
    monkeypatch.delitem(sys.modules, 'endoscope_core.classifier.training', raising=False)
    options = ['--data', str(data), '--out', 'weights.safetensors']
    assert main(['train', '--model', 'cnn', *options]) == 2
    assert capsys.readouterr().err == (
        'endoscope: training the networks of the first paper needs PyTorch: run '
        '`make -C ros_ws train`, which says how large it is\n'
    )
    assert list(tmp_path.iterdir()) == []


def test_identifying_a_data_set_gives_a_set_for_each_class(data, tmp_path):
    out = tmp_path / 'classes.json'
    source = [str(data), '--model', 'bouc_wen', '--per-class', '1', '--out', str(out)]
    assert main(['identify', *source]) == 0
    sets = load_class_parameters(out)
    assert sorted(sets) == [40, 50, 60, 70, 80, 90, 100]
    assert sets[100].lag > 1.5 * sets[40].lag
    written = json.loads(out.read_text())
    assert written['dataset_manifest_sha256'] == load_dataset(data).manifest_hash


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
    modelled = bouc_wen_forward(model, Servo().answer(angle[:, 0], 1e-3))
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
    'command',
    [
        ['identify', 'nowhere', '--model', 'bouc_wen'],
        ['identify', 'nowhere', '--model', 'unheard_of'],
        ['identify', 'nowhere'],
        ['train', '--data', 'nowhere', '--out', 'x.safetensors'],
        ['dataset', '--out', 'x', '--n', '0'],
        ['dataset', '--out', 'x', '--n', '8'],
        ['dataset', '--out', 'x', '--reset-pretension'],
        ['dataset', '--out', 'x', '--motion', 'breif'],
    ],
)
def test_wrong_usage_is_one_line_and_exit_2(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    try:
        status = main(command)
    except SystemExit as leaving:
        status = leaving.code
    assert status == 2
    assert capsys.readouterr().err.count('\n') == 1
    assert list(tmp_path.iterdir()) == []

"""`endoscope dataset`, `train` and `fit`, one after the other as a person uses them."""

import json
import subprocess
import sys

import pytest

from endoscope_bringup.cli import main
from endoscope_core.classifier.cnn_classifier import load_classifier
from endoscope_core.identification import load_class_parameters
from endoscope_lab.dataset import load_dataset


@pytest.fixture(scope='module')
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp('learning') / 'data'
    assert main(['dataset', '--out', str(folder), '--seed', '5', '--n', '7']) == 0
    return folder


def test_the_data_set_records_how_it_was_made(data):
    dataset = load_dataset(data)
    assert (dataset.manifest['seed'], dataset.manifest['per_class']) == (5, 1)
    assert len(dataset.class_deg) == 7


def test_training_leaves_weights_with_how_they_were_made(tmp_path):
    pytest.importorskip('torch', reason='PyTorch is missing: make -C ros_ws train')
    out = tmp_path / 'weights.safetensors'
    options = ['--n', '40', '--steps', '10', '--seed', '3']
    assert main(['train', '--out', str(out), *options]) == 0
    described = json.loads(out.with_suffix('.json').read_text())
    assert described['command'] == (
        'endoscope train --motion sinusoid --seed 3 --n 40 --steps 10 --out weights.safetensors'
    )
    assert described['kind'] == 'cnn'
    assert (described['training']['rigs'], described['training']['held_out']) == (40, 8)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'weights.json',
        'weights.safetensors',
    ]
    assert load_classifier(out).motion == 'sinusoid'


def test_a_data_set_without_space_on_the_disk_is_named(tmp_path):
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


def test_without_pytorch_one_line_explains_how_to_install_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, 'torch', None)
    for name in ('endoscope_lab.training.cnn_training', 'endoscope_lab.training.network'):
        monkeypatch.delitem(sys.modules, name, raising=False)
    assert main(['train', '--out', 'weights.safetensors']) == 2
    assert capsys.readouterr().err == (
        'endoscope: training the networks of the first paper needs PyTorch: run '
        '`make -C ros_ws train`, which reports its size\n'
    )
    assert list(tmp_path.iterdir()) == []


@pytest.mark.nightly
def test_identifying_a_data_set_gives_a_set_for_each_class(data, tmp_path):
    out = tmp_path / 'classes.json'
    source = [str(data), '--model', 'bouc_wen', '--per-class', '1', '--out', str(out)]
    assert main(['fit', 'classes', *source]) == 0
    sets = load_class_parameters(out)
    assert sorted(sets) == [40, 50, 60, 70, 80, 90, 100]
    assert sets[100].lag > 1.5 * sets[40].lag
    written = json.loads(out.read_text())
    assert written['dataset_manifest_sha256'] == load_dataset(data).manifest_hash


@pytest.mark.parametrize(
    'command',
    [
        ['fit', 'classes', 'nowhere', '--model', 'bouc_wen', '--out', 'x.json'],
        ['fit', 'classes', 'nowhere', '--model', 'unheard_of', '--out', 'x.json'],
        ['fit', 'family', 'nowhere'],
        ['fit'],
        ['train', '--motion', 'breif', '--out', 'x.safetensors'],
        ['train', '--out', 'x.json'],
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

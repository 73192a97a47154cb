"""Classifier weights that are not what they should be are refused when they are loaded."""

import io
import json
import os
import pickle
import shutil
import zipfile

import pytest
import torch

from endoscope_core.classifier.classification import ClassifierError
from endoscope_core.classifier.inference import DEFAULT_WEIGHTS
from endoscope_core.classifier.shipped import load_classifier, shipped_weights
from endoscope_core.classifier.training import use_one_thread
from endoscope_core.classifier.weights_file import sealed


@pytest.fixture(scope='module', autouse=True)
def one_thread():
    use_one_thread()


SIZE = shipped_weights('sinusoid')
CNN = SIZE.with_name(DEFAULT_WEIGHTS)


@pytest.fixture(params=[SIZE, CNN], ids=['size', 'cnn'])
def path(request, tmp_path):
    for suffix in ('.pt', '.json'):
        shutil.copy(request.param.with_suffix(suffix), tmp_path / f'weights{suffix}')
    return tmp_path / 'weights.pt'


def seal(path):
    """Make the description fit what is there, as somebody who forges weights would."""
    described = json.loads(path.with_suffix('.json').read_text())
    path.with_suffix('.json').write_text(json.dumps(sealed(described, path.read_bytes())))


def refused(path, what, forged=True):
    if forged:
        seal(path)
    with pytest.raises(ClassifierError, match=what) as caught:
        load_classifier(path)
    assert str(caught.value).isprintable()


def test_damage_is_noticed_in_either_file(path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    refused(path, 'damaged or exchanged', forged=False)
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    load_classifier(path)
    described = path.with_suffix('.json').read_text().replace('40', '30')
    path.with_suffix('.json').write_text(described)
    refused(path, 'damaged or exchanged', forged=False)


@pytest.mark.parametrize(
    ('spoil', 'what'),
    [
        (lambda t: t * torch.nan, 'not finite'),
        (lambda t: t[..., :-1].clone(), 'is due|not go together|no classifier weights'),
        (lambda t: t.to(torch.float16), 'float16'),
        (lambda t: t.new_ones(()).expand(1 << 40), 'no memory of its own'),
        (lambda t: [t], 'no dense tensor'),
    ],
)
def test_tensors_of_another_kind_are_refused(path, spoil, what):
    state = torch.load(path, weights_only=True)
    name = max(state, key=lambda key: state[key].numel())
    torch.save({**state, name: spoil(state[name])}, path)
    refused(path, what)


@pytest.mark.parametrize('value', [0.0, -1.0, 1.0, 3e38])
def test_garbage_of_the_right_shape_is_refused(tmp_path, value):
    path = tmp_path / 'weights.pt'
    shutil.copy(SIZE.with_suffix('.json'), tmp_path / 'weights.json')
    state = torch.load(SIZE, weights_only=True)
    torch.save({name: torch.full_like(tensor, value) for name, tensor in state.items()}, path)
    refused(path, 'not positive|not orthonormal')
    noise = {name: torch.randn_like(tensor).abs() for name, tensor in state.items()}
    torch.save({**state, 'scores': noise['scores']}, path)
    refused(path, 'not whitened')
    torch.save({**state, 'target': state['target'] + 7.0}, path)
    refused(path, 'no angles')


def test_numbers_without_an_answer_are_refused(tmp_path):
    path = tmp_path / 'weights.pt'
    shutil.copy(CNN.with_suffix('.json'), tmp_path / 'weights.json')
    state = torch.load(CNN, weights_only=True)
    big = {k: t * 1e30 if t.is_floating_point() else t for k, t in state.items()}
    torch.save(big, path)
    refused(path, 'answers are not finite')


class _Program:
    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


def test_no_program_in_a_file_runs(path, tmp_path):
    program = _Program(tmp_path / 'ran')
    path.write_bytes(pickle.dumps(program))
    refused(path, 'no PyTorch file')
    torch.save({'centre': program}, path)
    refused(path, 'tensors only')
    assert not (tmp_path / 'ran').exists()


def test_an_archive_that_grows_when_unpacked_is_not_unpacked(path):
    out = io.BytesIO()
    with zipfile.ZipFile(path) as sound, zipfile.ZipFile(out, 'w', zipfile.ZIP_DEFLATED) as packed:
        for name in sound.namelist():
            packed.writestr(name, bytes(1 << 24) if name.endswith('/0') else sound.read(name))
    path.write_bytes(out.getvalue())
    refused(path, 'PyTorch does not compress them')


@pytest.mark.parametrize(
    'change',
    [
        {'classes_deg': [40, float('nan')]},
        {'classes_deg': [50, 40]},
        {'classes_deg': 10**400},
        {'classes_deg': [[40]]},
        {'motion': ['sinusoid'], 'kind': 'size'},
        {'kind': {}},
        {'inflation': float('nan'), 'channels': [10**9] * 8},
        {'ceilings': [1.0], 'channels': None},
    ],
)
def test_descriptions_that_do_not_fit_are_refused(path, change):
    described = json.loads(path.with_suffix('.json').read_text())
    path.with_suffix('.json').write_text(json.dumps(described | change))
    refused(path, 'no classifier')


@pytest.mark.parametrize('text', ['[' * 10**5, '{"schema": 2', '9' * 5000, '[]', ''])
def test_a_description_that_is_none_is_refused(path, text):
    path.with_suffix('.json').write_text(text)
    refused(path, 'no classifier weights', forged=False)

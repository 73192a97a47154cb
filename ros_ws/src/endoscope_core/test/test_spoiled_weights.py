"""Classifier weights that are not what they should be are refused when they are loaded."""

import json
import os
import pickle
import shutil
import struct
import subprocess
import sys

import numpy as np
import pytest
import safetensors.numpy

from endoscope_core.classifier.classification import ClassifierError
from endoscope_core.classifier.cnn_classifier import load_classifier, sealed, shipped_weights

CNN = shipped_weights('sinusoid')


@pytest.fixture
def path(tmp_path):
    for suffix in ('.safetensors', '.json'):
        shutil.copy(CNN.with_suffix(suffix), tmp_path / f'weights{suffix}')
    return tmp_path / 'weights.safetensors'


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


def with_header(path, change):
    """Write the file anew with another header over the same numbers."""
    data = path.read_bytes()
    end = 8 + struct.unpack('<Q', data[:8])[0]
    header = json.loads(data[8:end])
    change(header)
    text = json.dumps(header).encode()
    path.write_bytes(struct.pack('<Q', len(text)) + text + data[end:])


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
        (lambda x: x * np.nan, 'not finite'),
        (lambda x: x[..., :-1], 'is due|not go together|no classifier weights'),
        (lambda x: x.astype(np.float16), 'float16'),
        (lambda x: x.astype(bool), 'bool'),
    ],
)
def test_arrays_of_another_kind_are_refused(path, spoil, what):
    state = safetensors.numpy.load_file(path)
    name = max(state, key=lambda key: state[key].size)
    spoilt = np.ascontiguousarray(spoil(state[name]))
    safetensors.numpy.save_file({**state, name: spoilt}, path)
    refused(path, what)


@pytest.mark.parametrize(
    'change',
    [
        lambda entry: entry.update(shape=[1 << 40]),
        lambda entry: entry.update(shape=[1 << 40, 1 << 40]),
        lambda entry: entry.update(data_offsets=[0, 1 << 40]),
        lambda entry: entry.update(dtype='BF16', shape=[2 * entry['shape'][0]]),
        lambda entry: entry.clear(),
    ],
)
def test_a_header_that_claims_what_is_not_there_is_refused(path, change):
    with_header(path, lambda header: change(header[max(header)]))
    refused(path, 'no safetensors file of numbers')


def test_numbers_without_an_answer_are_refused(tmp_path):
    path = tmp_path / 'weights.safetensors'
    shutil.copy(CNN.with_suffix('.json'), tmp_path / 'weights.json')
    big = {k: x * np.float32(1e30) for k, x in safetensors.numpy.load_file(CNN).items()}
    safetensors.numpy.save_file(big, path)
    refused(path, 'answers are not finite')


class _Program:
    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (str(self.mark),)


def test_no_program_in_a_file_runs(path, tmp_path):
    path.write_bytes(pickle.dumps(_Program(tmp_path / 'ran')))
    refused(path, 'no safetensors file')
    assert not (tmp_path / 'ran').exists()


@pytest.mark.parametrize('schema', [3, 4])
def test_weights_of_an_older_version_are_refused_with_the_command_for_new_ones(path, schema):
    described = json.loads(path.with_suffix('.json').read_text())
    old = described | {'schema': schema, 'kind': 'size'}
    path.with_suffix('.json').write_text(json.dumps(old))
    refused(path, 'make new ones with `endoscope train --out FILE`')


def test_weights_for_another_motion_are_refused(path):
    with pytest.raises(ClassifierError, match='trained on the sinusoid calibration'):
        load_classifier(path, 'brief')


def test_judging_needs_no_pytorch():
    program = (
        'import sys\n'
        'import numpy as np\n'
        'from endoscope_core.classifier.cnn_classifier import load_classifier\n'
        'classifier = load_classifier()\n'
        'classifier.judged(np.ones((1, 6561, 4), np.float32))\n'
        "print('torch' in sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, '-c', program], capture_output=True, text=True, check=False
    )
    assert (done.stdout.split(), done.stderr) == (['False'], '')


@pytest.mark.parametrize(
    'change',
    [
        {'classes_deg': [40, float('nan')]},
        {'classes_deg': [50, 40]},
        {'classes_deg': 10**400},
        {'classes_deg': [[40]]},
        {'motion': ['sinusoid']},
        {'motion': 1},
        {'inflation': float('nan')},
        {'ceiling': [1.0]},
        {'ceiling': -1.0},
        {'doubt': 0.0},
    ],
)
def test_descriptions_that_do_not_fit_are_refused(path, change):
    described = json.loads(path.with_suffix('.json').read_text())
    path.with_suffix('.json').write_text(json.dumps(described | change))
    refused(path, 'no classifier|was trained on')

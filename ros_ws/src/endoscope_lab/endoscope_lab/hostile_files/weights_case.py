"""Spoiled classifier weights: damaged files, arrays that claim to be others, pickled programs."""

import json
import os
import pickle
import shutil
import struct
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from numpy.random import Generator

from endoscope_core.classifier.classification import WIRES, ClassifierError, UnseenTensionError
from endoscope_core.classifier.weights_file import load_classifier, sealed, shipped_weights
from endoscope_core.signals import SINUSOID, calibration_motion
from endoscope_lab.hostile_files.spoiling import boundary, spoiled_bytes, spoiled_yaml

_HEAD = 8


class _Program:
    """Unpickled, it would make a file."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return os.mkdir, (str(self._mark),)


class WeightsCase:
    """Weights that come with the project, spoiled and loaded."""

    def __init__(self, folder: Path) -> None:
        self._path, self._mark = folder / 'weights.safetensors', folder / 'ran'
        self._sound = shipped_weights(SINUSOID)
        self._state = safetensors.numpy.load_file(self._sound)
        samples = calibration_motion(SINUSOID).samples
        wave = 1.0 + np.sin(np.arange(samples)[:, None] * 1e-3 + np.arange(WIRES))
        self._tension = 5.0 * wave
        shutil.copy(self._sound, self._path)
        shutil.copy(self._sound.with_suffix('.json'), self._path.with_suffix('.json'))
        self._sound_answer = self._answer()

    def spoil(self, rng: Generator) -> None:
        sound = self._sound
        data, described = sound.read_bytes(), sound.with_suffix('.json').read_bytes()
        way = rng.integers(7)
        self._told = way < 3
        if way < 2:
            data = spoiled_bytes(data, rng)
        elif way == 2:
            described = spoiled_yaml(described.decode(), rng)
        elif way == 3:
            data = safetensors.numpy.save(_other_state(dict(self._state), rng))
        elif way == 4:
            data = _other_header(data, rng)
        elif way == 5:
            data = pickle.dumps(_Program(self._mark), protocol=int(rng.integers(5)))
        else:
            described = json.dumps(_other_number(json.loads(described), rng)).encode()
        if way > 2:
            described = _sealed(described, data)
        self._path.write_bytes(data)
        self._path.with_suffix('.json').write_bytes(described)

    def read(self) -> bool:
        """Load it; nothing in it may have run, and what was only damaged answers as before."""
        answer = self._answer()
        told = not self._told or answer == self._sound_answer
        return told and not self._mark.exists()

    def _answer(self) -> str:
        try:
            classifier = load_classifier(self._path, SINUSOID)
        except ClassifierError:
            if self._mark.exists():
                return 'ran'
            raise
        try:
            return str(classifier.classify(self._tension))
        except UnseenTensionError as error:
            return str(error)


def _sealed(described: bytes, data: bytes) -> bytes:
    return json.dumps(sealed(json.loads(described), data)).encode()


def _other_header(data: bytes, rng: Generator) -> bytes:
    """Another shape, type or place for some array, or a header that is none."""
    length = struct.unpack('<Q', data[:_HEAD])[0]
    header, numbers = json.loads(data[_HEAD : _HEAD + length]), data[_HEAD + length :]
    way = rng.integers(6)
    if way == 0:
        return struct.pack('<Q', int(2 ** rng.uniform(0.0, 63.9))) + data[_HEAD:]
    if way == 1:
        text = spoiled_bytes(data[_HEAD : _HEAD + length], rng)
    else:
        entry = header[str(rng.choice(list(header)))]
        huge = int(2 ** rng.uniform(0.0, 70.0))
        if way == 2:
            entry['shape'] = [[huge, huge], [-1], [0], 'x', [[1]], None][rng.integers(6)]
        elif way == 3:
            entry['dtype'] = ['F16', 'BF16', 'F8_E4M3', 'I64', 'BOOL', 'C64', 1][rng.integers(7)]
        elif way == 4:
            entry['data_offsets'] = [[0, huge], [huge, 0], [-1, 8], []][rng.integers(4)]
        else:
            header[str(boundary(rng))] = dict(entry)
        text = json.dumps(header).encode()
    return struct.pack('<Q', len(text)) + text + numbers


def _other_state(state: dict[str, Any], rng: Generator) -> dict[str, Any]:
    for _ in range(rng.integers(1, 4)):
        name = str(rng.choice(list(state)))
        array = state[name]
        way = rng.integers(7)
        if way == 0:
            state.pop(name)
        elif way == 1:
            value = float(rng.choice((np.nan, np.inf, 0.0, -1.0)))
            state[name] = np.full(array.shape, value)
        elif way == 2:
            state[name] = np.ones(1 << int(rng.integers(1, 22)), array.dtype)
            break
        elif way == 3:
            with np.errstate(over='ignore', invalid='ignore'):
                state[name] = array.astype((np.float16, np.int64, np.bool_)[rng.integers(3)])
        elif way == 4:
            state[name] = array.ravel()[: int(rng.integers(array.size + 1))].copy()
        elif way == 5:
            drawn = rng.normal(size=array.shape)
            state[name] = np.asarray(drawn, array.dtype)
        else:
            with np.errstate(over='ignore'):
                scaled = array * 10.0 ** rng.uniform(-300.0, 300.0)
                state[name] = np.asarray(scaled, array.dtype)
        if not state:
            break
    return state


def _other_number(description: dict[str, Any], rng: Generator) -> dict[str, Any]:
    key = str(rng.choice(list(description)))
    evil: tuple[Any, ...] = (float('nan'), float('inf'), -1, 0, 1e308, [], {}, None, 'x', True)
    drawn = (*evil, boundary(rng), [boundary(rng)] * 3, [[0.5]] * 7, [40, 40], ['a'])
    description[key] = drawn[rng.integers(len(drawn))]
    return description

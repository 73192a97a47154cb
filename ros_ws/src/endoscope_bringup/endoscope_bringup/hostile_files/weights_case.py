"""Spoiled classifier weights: archives, tensors that claim to be others, programs in pickles."""

import io
import json
import os
import pickle
import shutil
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.random import Generator

from endoscope_bringup.hostile_files.spoiling import boundary, spoiled_bytes, spoiled_yaml
from endoscope_core.classifier.classification import ClassifierError, UnseenTensionError
from endoscope_core.classifier.inference import DEFAULT_WEIGHTS
from endoscope_core.classifier.shipped import load_classifier, shipped_weights
from endoscope_core.classifier.standardised_tension import WIRES
from endoscope_core.classifier.training import use_one_thread
from endoscope_core.classifier.weights_file import sealed
from endoscope_core.signals import SINUSOID, calibration_motion


class _Program:
    """Unpickled, it would make a file."""

    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[Any, tuple[str]]:
        return os.mkdir, (str(self._mark),)


class WeightsCase:
    """Weights of either kind that come with the project, spoiled and loaded."""

    name = 'weights'

    def __init__(self, folder: Path) -> None:
        use_one_thread()
        self._path, self._mark = folder / 'weights.pt', folder / 'ran'
        size = shipped_weights(SINUSOID)
        self._sound = [size, size.with_name(DEFAULT_WEIGHTS)]
        self._states = [torch.load(path, weights_only=True) for path in self._sound]
        samples = calibration_motion(SINUSOID).samples
        wave = 1.0 + np.sin(np.arange(samples)[:, None] * 1e-3 + np.arange(WIRES))
        self._tension = 5.0 * wave
        self._answers = []
        for path in self._sound:
            shutil.copy(path, self._path)
            shutil.copy(path.with_suffix('.json'), self._path.with_suffix('.json'))
            self._answers.append(self._answer())

    def spoil(self, rng: Generator) -> None:
        """Write a case."""
        self._which = int(rng.integers(2))
        sound = self._sound[self._which]
        data, described = sound.read_bytes(), sound.with_suffix('.json').read_bytes()
        way = rng.integers(6)
        self._told = way < 3
        if way < 2:
            data = spoiled_bytes(data, rng)
        elif way == 2:
            described = spoiled_yaml(described.decode(), rng)
        elif way == 3:
            data = _saved(_other_state(dict(self._states[self._which]), rng))
        elif way == 4:
            data = self._with_program(data, rng)
        else:
            described = json.dumps(_other_number(json.loads(described), rng)).encode()
        if way > 2:
            described = _sealed(described, data)
        self._path.write_bytes(data)
        self._path.with_suffix('.json').write_bytes(described)

    def _with_program(self, data: bytes, rng: Generator) -> bytes:
        program = _Program(self._mark)
        way = rng.integers(4)
        if way == 0:
            return pickle.dumps(program, protocol=int(rng.integers(5)))
        if way == 1:
            return _saved({'centre': program})
        out = io.BytesIO()
        packing = zipfile.ZIP_DEFLATED if way == 2 else zipfile.ZIP_STORED
        with zipfile.ZipFile(io.BytesIO(data)) as sound, zipfile.ZipFile(out, 'w', packing) as new:
            for name in sound.namelist():
                content = sound.read(name)
                if name.endswith('data.pkl') and rng.random() < 0.7:
                    content = pickle.dumps(program, protocol=2)
                elif rng.random() < 0.1:
                    content = bytes(1 << int(rng.integers(10, 25)))
                new.writestr(name, content)
        return out.getvalue()

    def read(self) -> bool:
        """Load it; nothing in it may have run, and what was only damaged answers as before."""
        answer = self._answer()
        told = not self._told or answer == self._answers[self._which]
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


def _saved(state: dict[str, Any]) -> bytes:
    out = io.BytesIO()
    torch.save(state, out)
    return out.getvalue()


def _other_state(state: dict[str, Any], rng: Generator) -> dict[str, Any]:
    for _ in range(rng.integers(1, 4)):
        name = str(rng.choice(list(state)))
        tensor = state[name]
        way = rng.integers(8)
        if way == 0:
            state.pop(name)
        elif way == 1:
            value = float(rng.choice((np.nan, np.inf, 0.0, -1.0)))
            state[name] = torch.full_like(tensor, value, dtype=torch.float64)
        elif way == 2:
            state[name] = tensor.new_ones(()).expand(1 << int(rng.integers(1, 40)))
            break
        elif way == 3:
            state[name] = tensor.to((torch.float16, torch.int64, torch.bool)[rng.integers(3)])
        elif way == 4:
            state[name] = tensor.flatten()[: int(rng.integers(tensor.numel() + 1))].clone()
        elif way == 5:
            state[name] = torch.as_tensor(rng.normal(size=tuple(tensor.shape))).to(tensor.dtype)
        elif way == 6:
            state[name] = tensor * float(10.0 ** rng.uniform(-300.0, 300.0))
        else:
            state[str(boundary(rng))] = [tensor]
        if not state:
            break
        state = {key: value for key, value in state.items() if isinstance(value, torch.Tensor)}
    return state


def _other_number(description: dict[str, Any], rng: Generator) -> dict[str, Any]:
    key = str(rng.choice(list(description)))
    evil: tuple[Any, ...] = (float('nan'), float('inf'), -1, 0, 1e308, [], {}, None, 'x', True)
    drawn = (*evil, boundary(rng), [boundary(rng)] * 3, [[0.5]] * 7, [40, 40], ['a'])
    description[key] = drawn[rng.integers(len(drawn))]
    return description

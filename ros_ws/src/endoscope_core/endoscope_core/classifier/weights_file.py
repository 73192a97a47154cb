"""Weights of classifiers as files, and those that are shipped."""

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, fields
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import safetensors.numpy
from msgspec import Meta
from numpy.typing import DTypeLike
from safetensors import SafetensorError

from endoscope_core.classifier.classification import WIRE_COUNT, ClassifierError
from endoscope_core.classifier.cnn_classifier import (
    CnnClassifier,
    HeldOutCalibration,
    cnn_shapes,
    course,
)
from endoscope_core.schema import read, within
from endoscope_core.signals import SINUSOID, calibration_motion

SCHEMA = 5
SEAL = 'sha256'
LARGEST_WEIGHTS, LARGEST_DESCRIPTION = 16 << 20, 1 << 20
"""In bytes. The largest that come with this package have 218 kB and 3 kB."""
_Positive = Annotated[float, Meta(gt=0.0, le=sys.float_info.max, description='a positive number')]


def read_weights(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Description and arrays of a weights file; ClassifierError if missing, foreign or damaged."""
    path = Path(path)
    sidecar = path.with_suffix('.json')
    for each, largest in ((path, LARGEST_WEIGHTS), (sidecar, LARGEST_DESCRIPTION)):
        if not each.is_file():
            raise ClassifierError(
                f'{each} is missing: make classifier weights with `endoscope train --out FILE`'
            )
        if each.stat().st_size > largest:
            raise ClassifierError(f'{each} holds no classifier weights: larger than {largest} B')
    try:
        description = json.loads(sidecar.read_text(encoding='utf-8'))
        data = path.read_bytes()
    except (OSError, ValueError, RecursionError) as error:
        raise unusable(sidecar, error) from error
    if not isinstance(description, dict) or description.get('schema') != SCHEMA:
        raise ClassifierError(
            f'{sidecar} holds no classifier weights of schema {SCHEMA}: make new ones with '
            '`endoscope train --out FILE`'
        )
    if description.get(SEAL) != sealed(description, data)[SEAL]:
        raise ClassifierError(
            f'{path} holds no classifier weights: it and {sidecar.name} are not what was written '
            'together, one of them was damaged or exchanged'
        )
    try:
        state = safetensors.numpy.load(data)
    except (SafetensorError, ValueError, KeyError) as error:
        raise ClassifierError(
            f'{path} holds no classifier weights: it is no safetensors file of numbers ({error})'
        ) from error
    for name, array in state.items():
        if not np.all(np.isfinite(array)):
            raise unusable(path, ValueError(f'{name} holds values that are not finite'))
    return description, state


def sealed(description: dict[str, Any], data: bytes) -> dict[str, Any]:
    """The description with the SHA-256 of itself and of the weights, which ties them together."""
    rest = {key: value for key, value in description.items() if key != SEAL}
    digest = sha256(json.dumps(rest, sort_keys=True).encode() + data).hexdigest()
    return {**rest, SEAL: digest}


def fitting(
    state: dict[str, np.ndarray], shapes: Mapping[str, tuple[int, ...]], dtype: DTypeLike
) -> dict[str, np.ndarray]:
    """The arrays, whose names, shapes and type must be those that are due, or ValueError."""
    for name in shapes.keys() | state.keys():
        if name not in state or name not in shapes:
            raise ValueError(f'{name} is {"missing" if name in shapes else "unknown"}')
        found, due = state[name], shapes[name]
        if found.shape != due or found.dtype != dtype:
            raise ValueError(
                f'{name} is {found.dtype} {list(found.shape)} where {np.dtype(dtype)} {list(due)} '
                'is due'
            )
    return state


def unusable(path: str | Path, error: Exception) -> ClassifierError:
    """The error to raise where what was read does not fit together."""
    return ClassifierError(f'{path} holds no classifier weights: {error}')


@dataclass(frozen=True)
class _Description:
    """What the classifier needs of a description, which says more."""

    motion: str
    classes_deg: tuple[Annotated[int, within(0, 360)], ...]
    inflation: _Positive
    ceiling: _Positive
    doubt: _Positive

    def __post_init__(self) -> None:
        if len(self.classes_deg) < 2 or list(self.classes_deg) != sorted(set(self.classes_deg)):
            raise ValueError('classes_deg must be two or more, increasing')


def shipped_weights(motion: str) -> Path:
    """The weights that come with this package for a calibration motion."""
    name = f'cnn_{motion}.safetensors'
    return Path(str(files('endoscope_core.classifier') / 'weights' / name))


def load_classifier(weights: str | Path | None = None, motion: str = SINUSOID) -> CnnClassifier:
    """Classifier for a calibration motion, by default with the weights that come with this package.

    ClassifierError where a file is missing, is not what `endoscope train` writes, was damaged, is
    for another motion, or holds numbers that give no answer.
    """
    path = Path(weights) if weights else shipped_weights(motion)
    description, state = read_weights(path)
    try:
        needed = {
            f.name: description[f.name] for f in fields(_Description) if f.name in description
        }
        described = read(_Description, needed, path.with_suffix('.json').name)
        own = fitting(state, cnn_shapes(len(described.classes_deg)), np.float32)
    except ValueError as error:
        raise unusable(path, error) from error
    if described.motion != motion:
        raise ClassifierError(
            f'{path} was trained on the {described.motion} calibration, not the {motion} one'
        )
    calibration = HeldOutCalibration(described.inflation, described.ceiling, described.doubt)
    classifier = CnnClassifier(own, calibration, described.classes_deg, motion)
    # Slack wires' constant tension shows whether the numbers go together at all.
    slack = np.full((calibration_motion(motion).samples, WIRE_COUNT), 1.0)
    judgement = classifier.judged(course(slack, motion)[None])
    if not all(np.all(np.isfinite(x)) for x in vars(judgement).values()):
        raise ClassifierError(f'{path} holds no classifier weights: its answers are not finite')
    return classifier

"""Classifier weights on disk: a safetensors file, and beside it how they were made."""

import json
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import safetensors.numpy
from numpy.typing import DTypeLike
from safetensors import SafetensorError

from endoscope_core.atomic_output import write_bytes, write_text
from endoscope_core.classifier.classification import ClassifierError
from endoscope_core.classifier.grouped_folds import CrossValidation
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.errors import EndoscopeError

SCHEMA = 4
CNN = 'cnn'
SIZE = 'size'
SEAL = 'sha256'
LARGEST_WEIGHTS, LARGEST_DESCRIPTION = 16 << 20, 1 << 20
"""In bytes. The largest that come with this package have 222 kB and 1.5 kB."""


class WeightsFileError(EndoscopeError, ValueError):
    """A name under which weights cannot be kept."""


def weights_path(path: str | Path) -> Path:
    """Check the name of a weights file before long work.

    Raises
    ------
    WeightsFileError
        If its suffix is .json, which the file beside it needs, or it is a folder.
    """
    path = Path(path)
    if path.suffix == '.json' or path.is_dir():
        raise WeightsFileError(f'{path} cannot hold weights: name a file with suffix .safetensors')
    return path


def save_weights(
    path: str | Path,
    state: Mapping[str, np.ndarray],
    kind: str,
    own: Mapping[str, Any],
    dataset: CalibrationDataset,
    validation: CrossValidation,
    command: str,
    seed: int,
) -> None:
    """Write ``path`` and the JSON file of the same name beside it.

    Parameters
    ----------
    path : path
        Of the weights; suffix .safetensors by custom.
    state : mapping of str to ndarray
    kind : str
        `CNN` or `SIZE`.
    own : mapping
        What a description of that kind has to say besides; in `held_out`, of the validation.
    dataset : CalibrationDataset
        That the classifier was trained on, all of it.
    validation : CrossValidation
        On the same data set.
    command : str
        That made them.
    seed : int
        Of the training.

    Raises
    ------
    WeightsFileError
        If `path` cannot hold weights.
    """
    path = weights_path(path)
    held_out = {
        'grouped_by': 'tube configuration',
        'accuracy': list(validation.accuracy),
        'mean_accuracy': validation.mean_accuracy,
        'confusion': validation.confusion.tolist(),
    }
    description = {
        'schema': SCHEMA,
        'kind': kind,
        'motion': dataset.motion,
        'classes_deg': list(CLASSES_DEG),
        **own,
        'command': command,
        'seed': seed,
        'dataset': {
            'manifest_sha256': dataset.manifest_hash,
            'seed': dataset.manifest['seed'],
            'per_class': dataset.manifest['per_class'],
        },
        'held_out': held_out | own.get('held_out', {}),
    }
    state = {name: np.asarray(array, order='C') for name, array in state.items()}
    data = safetensors.numpy.save(state)
    write_bytes(path, data)
    write_text(path.with_suffix('.json'), json.dumps(sealed(description, data), indent=1) + '\n')


def read_weights(path: str | Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Description and arrays of a weights file.

    Raises
    ------
    ClassifierError
        If a file is missing, is not what `endoscope train` writes, or was damaged since.
    """
    path = Path(path)
    sidecar = path.with_suffix('.json')
    for each, largest in ((path, LARGEST_WEIGHTS), (sidecar, LARGEST_DESCRIPTION)):
        if not each.is_file():
            raise ClassifierError(
                f'{each} is missing: make classifier weights with `endoscope train`'
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
            f'{sidecar} holds no classifier weights of schema {SCHEMA}: train again with '
            '`endoscope train`'
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
    """The arrays, whose names, shapes and type must be those that are due.

    Raises
    ------
    ValueError
        If they are not.
    """
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


def classes_of(description: dict[str, Any]) -> tuple[int, ...]:
    """Backlash sizes in deg of the classes.

    Raises
    ------
    ValueError
        If they are not whole, increasing degrees of a turn.
    """
    classes = description.get('classes_deg')
    if (
        not isinstance(classes, list)
        or any(type(c) is not int or not 0 <= c <= 360 for c in classes)
        or len(classes) < 2
        or classes != sorted(set(classes))
    ):
        raise ValueError('classes_deg must be whole, increasing degrees')
    return tuple(classes)


def unusable(path: str | Path, error: Exception) -> ClassifierError:
    """The error to raise where what was read does not fit together."""
    return ClassifierError(f'{path} holds no classifier weights: {error}')

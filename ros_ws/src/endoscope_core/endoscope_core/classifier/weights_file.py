"""Classifier weights on disk: a PyTorch file, and beside it the account of how they were made."""

import json
import struct
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any
from zipfile import ZIP_STORED, BadZipFile, ZipFile

import torch
from torch import Tensor, nn

from endoscope_core.atomic_output import write_bytes, write_text
from endoscope_core.classifier.classification import LEVEL, ClassifierError
from endoscope_core.classifier.grouped_folds import CrossValidation
from endoscope_core.classifier.size_classifier import SizeClassifier
from endoscope_core.classifier.size_training import SizeValidation
from endoscope_core.classifier.tension_cnn import CHANNELS, TensionCnn
from endoscope_core.classifier.training import Network, TrainingSettings
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.errors import EndoscopeError

SCHEMA = 3
CNN = 'cnn'
SIZE = 'size'
SEAL = 'sha256'
LARGEST_WEIGHTS, LARGEST_DESCRIPTION = 16 << 20, 1 << 20
"""In bytes. The largest that come with this package have 224 kB and 1.5 kB."""


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
        raise WeightsFileError(f'{path} cannot hold weights: name a file with suffix .pt')
    return path


def save_network(
    path: str | Path,
    network: Network,
    dataset: CalibrationDataset,
    validation: CrossValidation,
    command: str,
    seed: int,
) -> None:
    """Write ``path`` (state dict) and the JSON file of the same name beside it.

    Parameters
    ----------
    path : path
        Of the weights; suffix .pt by custom.
    network : Network
        Trained on all of `dataset`; a 1D-CNN, the others are only compared with it.
    dataset : CalibrationDataset
    validation : CrossValidation
        On the same data set.
    command : str
        That made them.
    seed : int
        Of the training.

    Raises
    ------
    WeightsFileError
        If the network is another, or `path` cannot hold weights.
    """
    if not isinstance(network, TensionCnn):
        raise WeightsFileError(f'{path}: weights of a {type(network).__name__} are not kept')
    own = {'channels': list(CHANNELS), 'training': vars(TrainingSettings())}
    held_out = _held_out(validation)
    _save(path, network.state_dict(), CNN, own, dataset, held_out, command, seed)


def save_size_classifier(
    path: str | Path,
    classifier: SizeClassifier,
    dataset: CalibrationDataset,
    validation: SizeValidation,
    command: str,
    seed: int,
) -> None:
    """Write a size classifier as `save_network` writes a network."""
    calibration = classifier.calibration
    own = {
        'intervals_hold': LEVEL,
        'inflation': calibration.inflation,
        'ceilings': list(calibration.ceilings),
    }
    held_out = _held_out(validation.classes) | {
        'size_rmse': list(validation.rmse),
        'interval_coverage': list(validation.coverage),
        'refused': validation.refused,
    }
    state = classifier.model.state_dict()
    _save(path, state, SIZE, own, dataset, held_out, command, seed)


def read_weights(path: str | Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Description and state dict of a weights file.

    Nothing in the file is run: PyTorch's unpickler for weights makes tensors and nothing else.

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
            f'{sidecar} holds no classifier weights of schema {SCHEMA}: make them anew with '
            '`endoscope train`'
        )
    if description.get(SEAL) != sealed(description, data)[SEAL]:
        raise ClassifierError(
            f'{path} holds no classifier weights: it and {sidecar.name} are not what was written '
            'together, one of them was damaged or exchanged'
        )
    _check_archive(path, data)
    try:
        state = torch.load(BytesIO(data), map_location='cpu', weights_only=True)
    except Exception as error:
        raise ClassifierError(
            f'{path} holds no classifier weights: it is no PyTorch file of tensors only'
        ) from error
    try:
        _check_state(state)
    except ValueError as error:
        raise unusable(path, error) from error
    return description, state


def sealed(description: dict[str, Any], data: bytes) -> dict[str, Any]:
    """The description with the SHA-256 of itself and of the weights, which ties them together."""
    rest = {key: value for key, value in description.items() if key != SEAL}
    digest = sha256(json.dumps(rest, sort_keys=True).encode() + data).hexdigest()
    return {**rest, SEAL: digest}


def _check_archive(path: Path, data: bytes) -> None:
    try:
        with ZipFile(BytesIO(data)) as archive:
            packed = any(entry.compress_type != ZIP_STORED for entry in archive.infolist())
    except (BadZipFile, OSError, ValueError, RuntimeError, EOFError, struct.error) as error:
        raise ClassifierError(
            f'{path} holds no classifier weights: it is no PyTorch file ({error})'
        ) from error
    if packed:
        raise ClassifierError(f'{path} holds no classifier weights: PyTorch does not compress them')


def _check_state(state: Any) -> None:
    if not isinstance(state, dict) or not state:
        raise ValueError('no state dict')
    for name, tensor in state.items():
        if not isinstance(tensor, Tensor) or tensor.layout != torch.strided:
            raise ValueError(f'{name} is no dense tensor')
        # A view can claim terabytes of one number.
        if tensor.device.type != 'cpu' or not tensor.is_contiguous():
            raise ValueError(f'{name} has no memory of its own')
        if not torch.isfinite(tensor).all():
            raise ValueError(f'{name} holds values that are not finite')


def filled[Kind: nn.Module](network: Kind, state: dict[str, Tensor]) -> Kind:
    """The network, made on PyTorch's device `meta` (without memory), with the tensors in it.

    Raises
    ------
    ValueError
        If names, shapes or types of the tensors are not those of the network.
    """
    wanted = network.state_dict()
    for name in wanted.keys() | state.keys():
        if name not in state or name not in wanted:
            raise ValueError(f'{name} is {"missing" if name in wanted else "unknown"}')
        found, due = state[name], wanted[name]
        if found.shape != due.shape or found.dtype != due.dtype:
            raise ValueError(
                f'{name} is {found.dtype} {list(found.shape)} where {due.dtype} '
                f'{list(due.shape)} is due'
            )
    network.load_state_dict(state, assign=True)
    return network


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


def _held_out(validation: CrossValidation) -> dict[str, Any]:
    return {
        'grouped_by': 'tube configuration',
        'accuracy': list(validation.accuracy),
        'mean_accuracy': validation.mean_accuracy,
        'confusion': validation.confusion.tolist(),
    }


def _save(
    path: str | Path,
    state: dict[str, Tensor],
    kind: str,
    own: dict[str, Any],
    dataset: CalibrationDataset,
    held_out: dict[str, Any],
    command: str,
    seed: int,
) -> None:
    path = weights_path(path)
    buffer = BytesIO()
    torch.save(state, buffer)
    write_bytes(path, buffer.getvalue())
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
        'held_out': held_out,
    }
    write_text(
        path.with_suffix('.json'),
        json.dumps(sealed(description, buffer.getvalue()), indent=1) + '\n',
    )

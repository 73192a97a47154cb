"""Classifier weights on disk: a PyTorch file, and beside it the account of how they were made."""

import json
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import torch
from torch import Tensor

from endoscope_core.atomic_output import atomic_file, write_text
from endoscope_core.classifier.classification import LEVEL, ClassifierError
from endoscope_core.classifier.grouped_folds import CrossValidation
from endoscope_core.classifier.size_classifier import SizeClassifier
from endoscope_core.classifier.size_training import SizeValidation
from endoscope_core.classifier.tension_cnn import CHANNELS, TensionCnn
from endoscope_core.classifier.training import Network, TrainingSettings
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.errors import EndoscopeError

SCHEMA = 2
CNN = 'cnn'
SIZE = 'size'


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

    Raises
    ------
    ClassifierError
        If a file is missing or is not what `endoscope train` writes.
    """
    path = Path(path)
    sidecar = path.with_suffix('.json')
    for each in (path, sidecar):
        if not each.is_file():
            raise ClassifierError(
                f'{each} is missing: make classifier weights with `endoscope train`'
            )
    try:
        description = json.loads(sidecar.read_text(encoding='utf-8'))
        state = torch.load(path, map_location='cpu', weights_only=True)
    except UnpicklingError as error:
        raise ClassifierError(
            f'{path} holds no classifier weights: it is no PyTorch file'
        ) from error
    except (OSError, ValueError, RuntimeError) as error:
        raise unusable(path, error) from error
    if not isinstance(description, dict) or description.get('schema') != SCHEMA:
        raise ClassifierError(
            f'{sidecar} holds no classifier weights of schema {SCHEMA}: make them anew with '
            '`endoscope train`'
        )
    return description, state


def unusable(path: str | Path, error: Exception) -> ClassifierError:
    """The error to raise where what was read does not fit together."""
    return ClassifierError(f'{path} holds no classifier weights: {str(error).splitlines()[0]}')


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
    with atomic_file(path) as partial:
        torch.save(state, partial)
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
    write_text(path.with_suffix('.json'), json.dumps(description, indent=1) + '\n')

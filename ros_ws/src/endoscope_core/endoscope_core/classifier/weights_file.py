"""Writes classifier weights and the account of how they were made."""

import json
from pathlib import Path

import torch

from endoscope_core.atomic_output import atomic_file, write_text
from endoscope_core.classifier.tension_cnn import CHANNELS, TensionCnn
from endoscope_core.classifier.training import CrossValidation, TrainingSettings
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.errors import EndoscopeError


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


def save_classifier(
    path: str | Path,
    network: TensionCnn,
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
    network : TensionCnn
        Trained on all of `dataset`.
    dataset : CalibrationDataset
    validation : CrossValidation
        On the same data set.
    command : str
        That made them.
    seed : int
        Of the training.
    """
    path = weights_path(path)
    settings = TrainingSettings()
    with atomic_file(path) as partial:
        torch.save(network.state_dict(), partial)
    description = {
        'schema': 1,
        'classes_deg': list(CLASSES_DEG),
        'channels': list(CHANNELS),
        'command': command,
        'seed': seed,
        'training': vars(settings),
        'dataset': {
            'manifest_sha256': dataset.manifest_hash,
            'seed': dataset.manifest['seed'],
            'per_class': dataset.manifest['per_class'],
        },
        'held_out': {
            'grouped_by': 'tube configuration',
            'accuracy': list(validation.accuracy),
            'mean_accuracy': validation.mean_accuracy,
            'confusion': validation.confusion.tolist(),
        },
    }
    write_text(path.with_suffix('.json'), json.dumps(description, indent=1) + '\n')

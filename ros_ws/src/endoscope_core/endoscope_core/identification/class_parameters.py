"""One Bouc-Wen parameter set for each hysteresis class: made from a data set, shipped, chosen."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from endoscope_core.dataset import CalibrationDataset
from endoscope_core.errors import EndoscopeError
from endoscope_core.hysteresis import BoucWenParameters
from endoscope_core.identification.feedforward_fit import FeedforwardFit, fit_feedforward
from endoscope_core.identification.hysteresis_fit import ModelFit, Recording, fit_model
from endoscope_core.identification.servo_lag import Servo
from endoscope_core.signals import CALIBRATION_RATE

DEFAULT_FILE = 'bouc_wen_classes.json'
_SAMPLE_STEP = 10


class ClassParameterError(EndoscopeError, ValueError):
    """A file that holds no parameter sets, or a class that has none."""


@dataclass(frozen=True)
class ClassIdentification:
    """What has been identified for one class."""

    class_deg: int
    model: ModelFit
    feedforward: FeedforwardFit


def identify_classes(
    dataset: CalibrationDataset,
    lead: float,
    seed: int = 0,
    recordings_per_class: int = 30,
    progress: Callable[[str], None] | None = None,
) -> list[ClassIdentification]:
    """Model and feed-forward of every class, from all its recordings and both joints at once.

    Parameters
    ----------
    dataset : CalibrationDataset
    lead : float
        s, of the compensator.
    seed : int
        Of the searches.
    recordings_per_class : int
        Use no more than this many of each class.
    progress : callable, optional
        Called with a line for each class.
    """
    servo = Servo()
    motor = servo.answer(dataset.desired_angle, 1.0 / CALIBRATION_RATE)[::_SAMPLE_STEP]
    found = []
    for class_deg in sorted({int(c) for c in dataset.class_deg}):
        chosen = np.flatnonzero(dataset.class_deg == class_deg)[:recordings_per_class]
        actual = dataset.actual_angle[chosen, ::_SAMPLE_STEP].astype(float)
        recordings = [
            Recording(motor, actual[k, :, j])
            for k in range(len(chosen))
            for j in range(actual.shape[2])
        ]
        model = fit_model(recordings, seed)
        feedforward = fit_feedforward(model.parameters, servo, lead, seed)
        found.append(ClassIdentification(class_deg, model, feedforward))
        if progress is not None:
            left = 100.0 * feedforward.rmse / feedforward.uncompensated_rmse
            progress(
                f'class {class_deg}: model {np.rad2deg(model.rmse):.2f} deg rms, '
                f'feed-forward leaves {left:.0f} % on it'
            )
    return found


def class_parameter_sets(
    identified: list[ClassIdentification], command: str, dataset_hash: str, lead: float
) -> dict[str, object]:
    """The content of a parameter file, with the command that made it."""
    return {
        'schema': 1,
        'model': 'bouc_wen',
        'command': command,
        'dataset_manifest_sha256': dataset_hash,
        'lead': lead,
        'classes': {
            str(item.class_deg): {
                'feedforward': _rounded(item.feedforward.parameters),
                'model': _rounded(item.model.parameters),
                'model_rmse': round(item.model.rmse, 6),
            }
            for item in identified
        },
    }


def load_class_parameters(path: str | Path | None = None) -> dict[int, BoucWenParameters]:
    """Feed-forward parameters by class (backlash size in deg).

    Parameters
    ----------
    path : path, optional
        A file of `endoscope identify DATASET`; the sets that come with this package if not given.

    Raises
    ------
    ClassParameterError
        If the file is missing, holds something else, or holds unsafe parameters.
    """
    if path is None:
        path = Path(str(files('endoscope_core.identification') / 'parameters' / DEFAULT_FILE))
    path = Path(path)
    if not path.is_file():
        raise ClassParameterError(
            f'{path} is missing: make parameter sets with `endoscope identify`'
        )
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding='utf-8'))
        return {
            int(class_deg): BoucWenParameters.from_dict(entry['feedforward'])
            for class_deg, entry in content['classes'].items()
        }
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ClassParameterError(f'{path} holds no Bouc-Wen parameter sets: {error}') from error


def parameters_for_class(
    sets: Mapping[int, BoucWenParameters], class_deg: int
) -> BoucWenParameters:
    """The set of a class.

    Raises
    ------
    ClassParameterError
        If there is none: parameters are never guessed.
    """
    if class_deg not in sets:
        known = ', '.join(str(c) for c in sorted(sets))
        raise ClassParameterError(f'no parameters for class {class_deg} deg (there are {known})')
    return sets[class_deg]


def _rounded(parameters: BoucWenParameters) -> dict[str, float]:
    return {name: float(f'{value:.7g}') for name, value in parameters.to_dict().items()}

"""A parameter set for each hysteresis class, fitted to a data set."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.choices import PHYSICAL
from endoscope_core.control.internal_model import PhysicalParameters
from endoscope_core.errors import InputError
from endoscope_core.identification.feedforward_fit import FeedforwardFit, Servo, fit_feedforward
from endoscope_core.identification.hysteresis_fit import HysteresisRecording, ModelFit, fit_model
from endoscope_core.identification.plant_fit import fit_plant
from endoscope_core.identification.updated_table import (
    KINDS,
    LawParameters,
    blend_joints,
)
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import CALIBRATION_RATE
from endoscope_lab.dataset import CalibrationDataset

_SAMPLE_STEP = 10


@dataclass(frozen=True)
class ClassIdentification:
    """Parameters identified for one class."""

    class_deg: int
    feedforward: LawParameters  # for the compensator
    model: LawParameters  # as fitted; the same for the plant
    rmse: float  # of the model on the recordings, rad, or N for the plant


def identify_classes(
    dataset: CalibrationDataset,
    lead: float,
    seed: int = 0,
    recordings_per_class: int = 30,
    progress: Callable[[str], None] | None = None,
    model: str = 'bouc_wen',
) -> list[ClassIdentification]:
    """Model and feed-forward of every class, from all its recordings and both joints at once.

    `lead` in s is that of the compensator, `model` one of `KINDS`. At most `recordings_per_class`
    are used; `progress` is called with a line for each class.
    """
    if model not in KINDS:
        raise InputError(f'unknown model {model!r}: choose one of {", ".join(KINDS)}')
    found = []
    for class_deg in sorted({int(c) for c in dataset.class_deg}):
        chosen = np.flatnonzero(dataset.class_deg == class_deg)[:recordings_per_class]
        if model == PHYSICAL:
            item, line = _plant_of_class(dataset, class_deg, chosen)
        else:
            item, line = _model_of_class(dataset, class_deg, chosen, lead, seed, model)
        found.append(item)
        if progress is not None:
            progress(line)
    return found


def _model_of_class(
    dataset: CalibrationDataset,
    class_deg: int,
    chosen: NDArray[np.intp],
    lead: float,
    seed: int,
    model: str,
) -> tuple[ClassIdentification, str]:
    servo = Servo()
    motor = servo.answer(dataset.desired_angle, 1.0 / CALIBRATION_RATE)[::_SAMPLE_STEP]
    actual = dataset.actual_angle[chosen, ::_SAMPLE_STEP].astype(float)
    recordings = [
        HysteresisRecording(motor, actual[k, :, j])
        for k in range(len(chosen))
        for j in range(actual.shape[2])
    ]
    fit: ModelFit = fit_model(recordings, seed, model)
    feedforward: FeedforwardFit = fit_feedforward(fit.parameters, servo, lead, seed)
    left = 100.0 * feedforward.rmse / feedforward.uncompensated_rmse
    line = (
        f'class {class_deg}: {model} {np.rad2deg(fit.rmse):.2f} deg rms, feed-forward leaves '
        f'{left:.0f} % on it'
    )
    return ClassIdentification(class_deg, feedforward.parameters, fit.parameters, fit.rmse), line


def _plant_of_class(
    dataset: CalibrationDataset, class_deg: int, chosen: NDArray[np.intp]
) -> tuple[ClassIdentification, str]:
    """Geometric mean of the plants of a class's recordings, each fitted to its tensions."""
    gear = shipped_rig().joints.gear
    fits = [
        fit_plant(dataset.desired_angle, dataset.tension[k, :, 2 * j : 2 * j + 2], gear=gear)
        for k in chosen.tolist()
        for j in range(dataset.tension.shape[2] // 2)
    ]
    joint = fits[0].parameters.joint
    for number, fit in enumerate(fits[1:], start=2):
        joint = blend_joints(joint, fit.parameters.joint, 1.0 / number)
    mean = PhysicalParameters(joint)
    rmse = float(np.mean([fit.tension_rmse for fit in fits]))
    line = (
        f'class {class_deg}: plant, {rmse:.3f} N rms of its own recordings, capstan exponent '
        f'{joint.capstan_exponent:.3f}'
    )
    return ClassIdentification(class_deg, mean, mean, rmse), line


def class_parameter_sets(
    identified: list[ClassIdentification],
    command: str,
    dataset_hash: str,
    lead: float,
    model: str = 'bouc_wen',
) -> dict[str, object]:
    """Content of a parameter file for a lead (s), with the command that made it."""
    return {
        'schema': 1,
        'model': model,
        'command': command,
        'dataset_manifest_sha256': dataset_hash,
        'lead': lead,
        'classes': {
            str(item.class_deg): {
                'feedforward': _rounded(item.feedforward),
                'model': _rounded(item.model),
                'model_rmse': round(item.rmse, 6),
            }
            for item in identified
        },
    }


def _rounded(parameters: LawParameters) -> dict[str, object]:
    return {
        name: [_short(v) for v in value] if isinstance(value, list) else _short(value)
        for name, value in parameters.to_dict().items()
    }


def _short(value: float) -> float:
    return float(f'{value:.7g}')

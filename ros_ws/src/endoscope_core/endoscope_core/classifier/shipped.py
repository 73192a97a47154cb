"""Opens classifier weights, by default those that come with this package."""

import sys
from dataclasses import dataclass, fields
from importlib.resources import files
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from endoscope_core.classifier.classification import WIRES, ClassifierError
from endoscope_core.classifier.cnn_classifier import (
    CnnClassifier,
    HeldOutCalibration,
    cnn_shapes,
    course,
)
from endoscope_core.classifier.weights_file import fitting, read_weights, unusable
from endoscope_core.schema import read, within
from endoscope_core.signals import SINUSOID, calibration_motion

_Positive = Annotated[float, Meta(gt=0.0, le=sys.float_info.max, description='a positive number')]


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
    slack = np.full((calibration_motion(motion).samples, WIRES), 1.0)
    judgement = classifier.judged(course(slack, motion)[None])
    if not all(np.all(np.isfinite(x)) for x in vars(judgement).values()):
        raise ClassifierError(f'{path} holds no classifier weights: its answers are not finite')
    return classifier

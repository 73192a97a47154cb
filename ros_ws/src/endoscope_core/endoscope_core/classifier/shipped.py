"""Opens classifier weights, by default those that come with this package."""

import math
from importlib.resources import files
from pathlib import Path

import numpy as np

from endoscope_core.classifier.classification import WIRES, ClassifierError
from endoscope_core.classifier.cnn_classifier import (
    CnnClassifier,
    HeldOutCalibration,
    cnn_shapes,
    course,
)
from endoscope_core.classifier.weights_file import classes_of, fitting, read_weights, unusable
from endoscope_core.signals import SINUSOID, calibration_motion


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
        classes = classes_of(description)
        calibration = HeldOutCalibration(
            *(float(description[key]) for key in ('inflation', 'ceiling', 'doubt'))
        )
        numbers = tuple(vars(calibration).values())
        if not all(math.isfinite(x) and x > 0.0 for x in numbers):
            raise ValueError(f'inflation, ceiling and doubt are {numbers}')
        if description['motion'] != motion:
            raise ClassifierError(
                f'{path} was trained on the {description["motion"]} calibration, not the '
                f'{motion} one'
            )
        own = fitting(state, cnn_shapes(len(classes)), np.float32)
    except ClassifierError:
        raise
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise unusable(path, error) from error
    classifier = CnnClassifier(own, calibration, classes, motion)
    # Slack wires' constant tension shows whether the numbers go together at all.
    slack = np.full((calibration_motion(motion).samples, WIRES), 1.0)
    judgement = classifier.judged(course(slack, motion)[None])
    if not all(np.all(np.isfinite(x)) for x in vars(judgement).values()):
        raise ClassifierError(f'{path} holds no classifier weights: its answers are not finite')
    return classifier

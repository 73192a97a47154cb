"""Opens classifier weights of either kind, by default those that come with this package."""

import math
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from endoscope_core.classifier.classification import (
    WIRES,
    Classifier,
    ClassifierError,
    UnseenTensionError,
)
from endoscope_core.classifier.inference import TensionClassifier
from endoscope_core.classifier.size_classifier import HeldOutCalibration, SizeClassifier
from endoscope_core.classifier.size_model import STRANGENESS, BacklashSizeModel
from endoscope_core.classifier.weights_file import (
    CNN,
    SIZE,
    classes_of,
    fitting,
    read_weights,
    unusable,
)
from endoscope_core.signals import SINUSOID, calibration_motion

MOST_KNOWN = 4096
"""Courses that a size model may know: their covariance, their square, is 134 MB then. Those that
come with this package know 420."""


def shipped_weights(motion: str) -> Path:
    """The size classifier that comes with this package for a calibration motion."""
    name = f'backlash_size_{motion}.safetensors'
    return Path(str(files('endoscope_core.classifier') / 'weights' / name))


def load_classifier(weights: str | Path | None = None, motion: str = SINUSOID) -> Classifier:
    """Classifier for a calibration motion.

    Parameters
    ----------
    weights : path, optional
        As `endoscope train` writes them; those that come with this package if not given.
    motion : str
        One of `CALIBRATION_MOTIONS`.

    Raises
    ------
    ClassifierError
        If a file is missing, is not what `endoscope train` writes, was damaged, is for another
        motion, or holds numbers that give no answer.
    """
    path = Path(weights) if weights else shipped_weights(motion)
    description, state = read_weights(path)
    kind = description.get('kind')
    if kind == CNN:
        classifier: Classifier = TensionClassifier.of(path, description, state)
    elif kind == SIZE:
        classifier = _size_classifier(path, description, state)
    else:
        raise ClassifierError(f'{path} holds no classifier: its kind is {kind!r}')
    if classifier.motion != motion:
        raise ClassifierError(
            f'{path} was trained on the {classifier.motion} calibration, not the {motion} one'
        )
    _try(path, classifier)
    return classifier


def _size_classifier(
    path: Path, description: dict[str, Any], state: dict[str, np.ndarray]
) -> SizeClassifier:
    try:
        ceilings = tuple(float(x) for x in description['ceilings'])
        calibration = HeldOutCalibration(float(description['inflation']), ceilings)
        numbers = (calibration.inflation, *ceilings)
        if len(ceilings) != len(STRANGENESS) or not all(map(math.isfinite, numbers)):
            raise ValueError(f'inflation and ceilings are {numbers}')
        known, components = state['scores'].shape
        if known > MOST_KNOWN:
            raise ValueError(f'it knows {known} courses, more than {MOST_KNOWN}')
        for name in ('spread', 'lengths', 'height', 'noise', 'rest', 'quiet'):
            if not np.all(state[name] > 0.0):
                raise ValueError(f'{name} is not positive')
        shapes = BacklashSizeModel.shapes(known, len(state['centre']), components)
        model = BacklashSizeModel(**fitting(state, shapes, np.float64))
        model.require_fitted()
        classes = classes_of(description)
        return SizeClassifier(model, calibration, classes, str(description['motion']))
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise unusable(path, error) from error


def _try(path: Path, classifier: Classifier) -> None:
    """Judge slack wires' constant tension, which shows whether the numbers go together at all."""
    samples = calibration_motion(classifier.motion).samples
    try:
        result = classifier.classify(np.full((samples, WIRES), 1.0))
    except UnseenTensionError:
        return
    except np.linalg.LinAlgError as error:
        raise unusable(path, error) from error
    if not all(map(math.isfinite, (*result.probabilities.values(), result.expected_size))):
        raise ClassifierError(f'{path} holds no classifier weights: its answers are not finite')

"""Opens classifier weights of either kind, by default those that come with this package."""

from importlib.resources import files
from pathlib import Path
from typing import Any

from torch import Tensor

from endoscope_core.classifier.classification import Classifier, ClassifierError
from endoscope_core.classifier.inference import TensionClassifier
from endoscope_core.classifier.size_classifier import HeldOutCalibration, SizeClassifier
from endoscope_core.classifier.size_model import BacklashSizeModel
from endoscope_core.classifier.weights_file import CNN, SIZE, read_weights, unusable
from endoscope_core.signals import SINUSOID


def shipped_weights(motion: str) -> Path:
    """The size classifier that comes with this package for a calibration motion."""
    return Path(str(files('endoscope_core.classifier') / 'weights' / f'backlash_size_{motion}.pt'))


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
        If a file is missing, is not what `endoscope train` writes, or is for another motion.
    """
    path = Path(weights) if weights else shipped_weights(motion)
    description, state = read_weights(path)
    kind = description.get('kind')
    if kind == CNN:
        classifier: Classifier = TensionClassifier.load(path)
    elif kind == SIZE:
        classifier = _size_classifier(path, description, state)
    else:
        raise ClassifierError(f'{path} holds no classifier: its kind is {kind!r}')
    if classifier.motion != motion:
        raise ClassifierError(
            f'{path} was trained on the {classifier.motion} calibration, not the {motion} one'
        )
    return classifier


def _size_classifier(
    path: Path, description: dict[str, Any], state: dict[str, Tensor]
) -> SizeClassifier:
    try:
        components, course = state['basis'].shape
        model = BacklashSizeModel(len(state['target']), course, components)
        model.load_state_dict(state)
        calibration = HeldOutCalibration(
            float(description['inflation']), tuple(float(x) for x in description['ceilings'])
        )
        classes = tuple(int(c) for c in description['classes_deg'])
        return SizeClassifier(model, calibration, classes, str(description['motion']))
    except (KeyError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise unusable(path, error) from error

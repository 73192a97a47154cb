"""Names the hysteresis class of a tube as the first paper does: by the 1D-CNN."""

from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from endoscope_core.classifier.classification import (
    CellReadings,
    ClassificationResult,
    ClassifierError,
    checked_tension,
    result_of,
)
from endoscope_core.classifier.standardised_tension import WIRES
from endoscope_core.classifier.tension_cnn import CHANNELS, TensionCnn
from endoscope_core.classifier.weights_file import classes_of, filled, read_weights, unusable
from endoscope_core.signals import CALIBRATION_SAMPLES, SINUSOID

DEFAULT_WEIGHTS = 'tension_cnn.pt'

__all__ = ['ClassificationResult', 'ClassifierError', 'TensionClassifier']


class TensionClassifier:
    """A trained network and the classes that it tells apart.

    Parameters
    ----------
    network : TensionCnn
    classes_deg : tuple of int
        Class of each output.
    """

    motion = SINUSOID

    def __init__(self, network: TensionCnn, classes_deg: tuple[int, ...]) -> None:
        self._network = network.eval()
        self.classes_deg = classes_deg

    @classmethod
    def load(cls, weights: str | Path) -> 'TensionClassifier':
        """Classifier from weights and the JSON file beside them.

        Parameters
        ----------
        weights : path
            As `endoscope train` writes them; the JSON file has the same name with suffix .json.

        Raises
        ------
        ClassifierError
            If a file is missing or is not what `endoscope train` writes.
        """
        return cls.of(weights, *read_weights(weights))

    @classmethod
    def of(
        cls, weights: str | Path, description: dict[str, Any], state: dict[str, Tensor]
    ) -> 'TensionClassifier':
        """Classifier from what `read_weights` returned; errors as in `load`."""
        try:
            classes = classes_of(description)
            channels = description.get('channels')
            if channels != list(CHANNELS):
                raise ValueError(f'channels are {channels}, not {list(CHANNELS)}')
            with torch.device('meta'):
                network = TensionCnn(len(classes))
            return cls(filled(network, state), classes)
        except ValueError as error:
            raise unusable(weights, error) from error

    @classmethod
    def load_default(cls) -> 'TensionClassifier':
        """The classifier that comes with this package."""
        return cls.load(Path(str(files('endoscope_core.classifier') / 'weights' / DEFAULT_WEIGHTS)))

    def classify(
        self, tension: ArrayLike, cells: CellReadings | None = None
    ) -> ClassificationResult:
        """Class of one calibration.

        Parameters
        ----------
        tension : array_like, shape (9000, 4)
            N at 1 kHz from the start of the calibration sinusoid, wires in the order x_pos,
            x_neg, y_pos, y_neg.
        cells : CellReadings, optional
            Of no account here: the network names a class for any tension.

        Raises
        ------
        ClassifierError
            If the shape is another or a value is not finite.
        """
        array = checked_tension(tension, (CALIBRATION_SAMPLES, WIRES), np.float32)
        with torch.inference_mode():
            logits = self._network(torch.from_numpy(np.ascontiguousarray(array.T)).unsqueeze(0))
            weights = torch.softmax(logits[0].double(), dim=0).tolist()
        return result_of(self.classes_deg, weights)

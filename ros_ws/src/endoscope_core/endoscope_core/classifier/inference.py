"""Names the hysteresis class of a tube as the first paper does: by the 1D-CNN."""

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.classifier.classification import (
    WIRES,
    CellReadings,
    ClassificationResult,
    ClassifierError,
    checked_tension,
    result_of,
)
from endoscope_core.classifier.weights_file import classes_of, fitting, read_weights, unusable
from endoscope_core.signals import CALIBRATION_SAMPLES, SINUSOID

DEFAULT_WEIGHTS = 'tension_cnn.safetensors'
STRIDE = 3
"""Step and width of each convolution."""
CHANNELS = (16, 16, 32, 32, 64, 64, 64, 64)
"""Outputs of the eight convolutions, which the paper does not give: 49 thousand weights."""

__all__ = ['ClassificationResult', 'ClassifierError', 'TensionClassifier']


class TensionClassifier:
    """The first paper's 1D-CNN as it was trained, and the classes that it tells apart.

    Batch normalisation is part of the convolutions here: once trained it is linear.

    Parameters
    ----------
    weights : mapping of str to ndarray of float32
        Of the shapes that `cnn_shapes` gives.
    classes_deg : tuple of int
        Class of each output.
    """

    motion = SINUSOID

    def __init__(
        self, weights: Mapping[str, NDArray[np.float32]], classes_deg: tuple[int, ...]
    ) -> None:
        self._weights = weights
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
        cls, weights: str | Path, description: dict[str, Any], state: dict[str, np.ndarray]
    ) -> 'TensionClassifier':
        """Classifier from what `read_weights` returned; errors as in `load`."""
        try:
            classes = classes_of(description)
            channels = description.get('channels')
            if channels != list(CHANNELS):
                raise ValueError(f'channels are {channels}, not {list(CHANNELS)}')
            return cls(fitting(state, cnn_shapes(len(classes)), np.float32), classes)
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
        logits = self._logits(array).astype(np.float64)
        weights = np.exp(logits - np.max(logits))
        return result_of(self.classes_deg, (weights / np.sum(weights)).tolist())

    def _logits(self, tension: NDArray[np.float32]) -> NDArray[np.float32]:
        w = self._weights
        # Numbers that overflow end in a probability that is none, which loading refuses.
        with np.errstate(over='ignore', invalid='ignore'):
            signal = (tension - w['offset']) / w['scale']
            for k in range(len(CHANNELS)):
                whole = len(signal) // STRIDE * STRIDE
                windows = signal[:whole].reshape(-1, STRIDE * signal.shape[1])
                signal = np.maximum(windows @ w[f'filter.{k}'] + w[f'bias.{k}'], 0.0)
            logits: NDArray[np.float32] = signal[-1] @ w['dense'] + w['bias']
            return logits


def cnn_shapes(classes: int) -> dict[str, tuple[int, ...]]:
    """Shape of each array of weights of the network for a number of classes.

    Eight strides of three reduce 9000 samples to exactly one. `offset` and `scale` are each wire's
    mean and spread in N in the training; a filter has a row for each sample of its window and each
    channel of that sample.
    """
    shapes: dict[str, tuple[int, ...]] = {'offset': (WIRES,), 'scale': (WIRES,)}
    for k, (width, wider) in enumerate(zip((WIRES, *CHANNELS), CHANNELS, strict=False)):
        shapes |= {f'filter.{k}': (STRIDE * width, wider), f'bias.{k}': (wider,)}
    return shapes | {'dense': (CHANNELS[-1], classes), 'bias': (classes,)}

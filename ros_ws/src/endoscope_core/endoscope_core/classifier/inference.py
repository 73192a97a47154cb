"""Names the hysteresis class of a tube from the wire tensions of one calibration."""

import json
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from pickle import UnpicklingError
from typing import Any

import numpy as np
import torch
from numpy.typing import ArrayLike

from endoscope_core.classifier.tension_cnn import WIRES, TensionCnn
from endoscope_core.errors import EndoscopeError
from endoscope_core.signals import CALIBRATION_SAMPLES

DEFAULT_WEIGHTS = 'tension_cnn.pt'


class ClassifierError(EndoscopeError, ValueError):
    """Weights that cannot be used, or tensions that are no calibration recording."""


@dataclass(frozen=True)
class ClassificationResult:
    """What the classifier says of one calibration.

    Parameters
    ----------
    class_deg : int
        The likeliest class: backlash size in deg.
    probability : float
        Of that class.
    probabilities : dict of int to float
        Of each class, by its size in deg; they add up to one.
    """

    class_deg: int
    probability: float
    probabilities: dict[int, float]

    @property
    def expected_size(self) -> float:
        """Mean backlash size in rad over the classes, weighted with their probabilities."""
        return float(np.deg2rad(sum(size * p for size, p in self.probabilities.items())))


class TensionClassifier:
    """A trained network and the classes that it tells apart.

    Parameters
    ----------
    network : TensionCnn
    classes_deg : tuple of int
        Class of each output.
    """

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
        weights = Path(weights)
        sidecar = weights.with_suffix('.json')
        for path in (weights, sidecar):
            if not path.is_file():
                raise ClassifierError(
                    f'{path} is missing: make classifier weights with `endoscope train`'
                )
        try:
            description: dict[str, Any] = json.loads(sidecar.read_text(encoding='utf-8'))
            classes = tuple(int(c) for c in description['classes_deg'])
            network = TensionCnn(len(classes), description['channels'])
            state = torch.load(weights, map_location='cpu', weights_only=True)
            network.load_state_dict(state)
        except UnpicklingError as error:
            raise ClassifierError(
                f'{weights} holds no classifier weights: it is no PyTorch file'
            ) from error
        except (OSError, KeyError, TypeError, ValueError, RuntimeError) as error:
            reason = str(error).splitlines()[0]
            raise ClassifierError(f'{weights} holds no classifier weights: {reason}') from error
        return cls(network, classes)

    @classmethod
    def load_default(cls) -> 'TensionClassifier':
        """The classifier that comes with this package."""
        return cls.load(Path(str(files('endoscope_core.classifier') / 'weights' / DEFAULT_WEIGHTS)))

    def classify(self, tension: ArrayLike) -> ClassificationResult:
        """Class of one calibration.

        Parameters
        ----------
        tension : array_like, shape (9000, 4)
            N at 1 kHz from the start of the calibration sinusoid, wires in the order x_pos,
            x_neg, y_pos, y_neg.

        Raises
        ------
        ClassifierError
            If the shape is another or a value is not finite.
        """
        array = np.asarray(tension, dtype=np.float32)
        if array.shape != (CALIBRATION_SAMPLES, WIRES):
            raise ClassifierError(
                f'tensions of a calibration have shape ({CALIBRATION_SAMPLES}, {WIRES}), '
                f'not {array.shape}'
            )
        if not np.all(np.isfinite(array)):
            raise ClassifierError('the tensions hold values that are not finite')
        with torch.inference_mode():
            logits = self._network(torch.from_numpy(np.ascontiguousarray(array.T)).unsqueeze(0))
            weights = torch.softmax(logits[0].double(), dim=0).tolist()
        probabilities = dict(zip(self.classes_deg, weights, strict=True))
        likeliest = max(probabilities, key=lambda size: probabilities[size])
        return ClassificationResult(likeliest, probabilities[likeliest], probabilities)

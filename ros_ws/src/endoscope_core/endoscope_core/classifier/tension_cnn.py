"""The 1D-CNN of Table 2 of the first paper."""

from collections.abc import Sequence

from torch import Tensor, nn

from endoscope_core.classifier.standardised_tension import WIRES, StandardisedTension
from endoscope_core.signals import CALIBRATION_SAMPLES

KERNEL = 3
STRIDE = 3
CHANNELS = (16, 16, 32, 32, 64, 64, 64, 64)


class TensionCnn(StandardisedTension):
    """Eight convolutions with batch normalisation and ReLU, then a dense layer.

    Eight strides of three reduce 9000 samples to exactly one, so that the dense layer sees one
    feature vector of the whole recording. The paper does not give the numbers of channels; these
    make 49 thousand weights. Softmax belongs to the loss in training and to the caller otherwise.

    Parameters
    ----------
    classes : int
        Number of classes.
    channels : sequence of int
        Output channels of the eight convolutions.
    """

    def __init__(self, classes: int, channels: Sequence[int] = CHANNELS) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        width = WIRES
        for wider in channels:
            layers += [nn.Conv1d(width, wider, KERNEL, STRIDE), nn.BatchNorm1d(wider), nn.ReLU()]
            width = wider
        self.features = nn.Sequential(*layers)
        length = CALIBRATION_SAMPLES
        for _ in channels:
            length //= STRIDE
        self.dense = nn.Linear(width * length, classes)

    def forward(self, tension: Tensor) -> Tensor:
        """Logits (R, classes) of tensions (R, 4, 9000) in N."""
        features = self.features(self.unitless(tension))
        logits: Tensor = self.dense(features.flatten(1))
        return logits

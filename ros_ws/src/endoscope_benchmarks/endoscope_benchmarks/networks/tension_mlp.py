"""The multilayer perceptron that the first paper compares its 1D-CNN with (Table 3)."""

from endoscope_core.classifier.classification import WIRES
from endoscope_core.classifier.network import StandardisedTension, Tensor, nn
from endoscope_core.signals import CALIBRATION_SAMPLES

DECIMATION = 10
HIDDEN = (500, 500, 500)
DROPOUT = (0.1, 0.2, 0.2, 0.3)


class TensionMlp(StandardisedTension):
    """Three hidden layers of 500 units with ReLU and dropout, then a dense layer.

    The paper says no more than "MLP"; this is the usual one for time series (Wang, Yan, Oates,
    IJCNN 2017, section II-A). It reads means over ten samples: 3600 numbers a recording.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        width = WIRES * CALIBRATION_SAMPLES // DECIMATION
        for units, dropout in zip(HIDDEN, DROPOUT[:-1], strict=True):
            layers += [nn.Dropout(dropout), nn.Linear(width, units), nn.ReLU()]
            width = units
        self.layers = nn.Sequential(*layers, nn.Dropout(DROPOUT[-1]), nn.Linear(width, classes))

    def forward(self, tension: Tensor) -> Tensor:
        """Logits (R, classes) of tensions (R, 4, 9000) in N."""
        means = nn.functional.avg_pool1d(self.unitless(tension), DECIMATION)
        logits: Tensor = self.layers(means.flatten(1))
        return logits

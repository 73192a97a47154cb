"""The multilayer perceptron that the first paper compares its 1D-CNN with (Table 3)."""

import torch
from torch import Tensor, nn
from torch.nn import functional

from endoscope_core.classifier.tension_cnn import WIRES
from endoscope_core.signals import CALIBRATION_SAMPLES

DECIMATION = 10
HIDDEN = (500, 500, 500)
DROPOUT = (0.1, 0.2, 0.2, 0.3)


class TensionMlp(nn.Module):
    """Three hidden layers of 500 units with ReLU and dropout, then a dense layer.

    The paper says no more than "MLP"; this is the usual one for time series (Wang, Yan, Oates,
    IJCNN 2017, section II-A). It reads means over ten samples: 3600 numbers a recording.

    Parameters
    ----------
    classes : int
        Number of classes.
    """

    offset: Tensor
    scale: Tensor

    def __init__(self, classes: int) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        width = WIRES * CALIBRATION_SAMPLES // DECIMATION
        for units, dropout in zip(HIDDEN, DROPOUT[:-1], strict=True):
            layers += [nn.Dropout(dropout), nn.Linear(width, units), nn.ReLU()]
            width = units
        self.layers = nn.Sequential(*layers, nn.Dropout(DROPOUT[-1]), nn.Linear(width, classes))
        self.register_buffer('offset', torch.zeros(WIRES, 1))
        self.register_buffer('scale', torch.ones(WIRES, 1))

    def standardise_by(self, tension: Tensor) -> None:
        """Take mean and spread of each wire over recordings (R, 4, N) as the unit of the input."""
        self.offset = tension.mean(dim=(0, 2)).unsqueeze(1)
        self.scale = tension.std(dim=(0, 2)).unsqueeze(1)

    def forward(self, tension: Tensor) -> Tensor:
        """Logits (R, classes) of tensions (R, 4, 9000) in N."""
        unitless = (tension - self.offset) / self.scale
        logits: Tensor = self.layers(functional.avg_pool1d(unitless, DECIMATION).flatten(1))
        return logits

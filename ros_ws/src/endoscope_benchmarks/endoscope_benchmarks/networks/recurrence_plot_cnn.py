"""The recurrence plot + CNN that the first paper compares its 1D-CNN with (Table 3)."""

from endoscope_core.classifier.classification import WIRES
from endoscope_core.classifier.network import Tensor, nn, torch
from endoscope_core.signals import CALIBRATION_SAMPLES

PIXELS = 60
FILTERS = 32
UNITS = 128


class RecurrencePlotCnn(nn.Module):
    """A recurrence plot for each wire, read by two convolutions as an image of four channels.

    After Hatami, Gavet, Debayle, ICMV 2017: the plot is the distance of every two states of the
    series, not thresholded; each of two stages has 32 filters of 3 x 3, ReLU, pooling and dropout,
    then follow 128 units. A state here is the tension averaged over 150 ms.
    """

    offset: Tensor
    scale: Tensor

    def __init__(self, classes: int) -> None:
        super().__init__()
        stages: list[nn.Module] = []
        width = WIRES
        for _ in range(2):
            stages += [nn.Conv2d(width, FILTERS, 3), nn.ReLU(), nn.MaxPool2d(2), nn.Dropout(0.25)]
            width = FILTERS
        side = ((PIXELS - 2) // 2 - 2) // 2
        self.layers = nn.Sequential(
            *stages,
            nn.Flatten(),
            nn.Linear(FILTERS * side**2, UNITS),
            nn.ReLU(),
            nn.Dropout(0.5),
            nn.Linear(UNITS, classes),
        )
        self.register_buffer('offset', torch.zeros(WIRES, 1, 1))
        self.register_buffer('scale', torch.ones(WIRES, 1, 1))

    def standardise_by(self, tension: Tensor) -> None:
        """Take mean and spread of each wire's plots of recordings (R, 4, N) as their unit."""
        plots = recurrence_plots(tension)
        self.offset = plots.mean(dim=(0, 2, 3))[:, None, None]
        self.scale = plots.std(dim=(0, 2, 3))[:, None, None]

    def forward(self, tension: Tensor) -> Tensor:
        """Logits (R, classes) of tensions (R, 4, 9000) in N."""
        logits: Tensor = self.layers((recurrence_plots(tension) - self.offset) / self.scale)
        return logits


def recurrence_plots(tension: Tensor) -> Tensor:
    """Distances in N (R, 4, P, P) of the states of recordings (R, 4, N)."""
    # Eckmann, Kamphorst, Ruelle, Europhys. Lett. 4(9), 1987, without the threshold.
    states = nn.functional.avg_pool1d(tension, CALIBRATION_SAMPLES // PIXELS)
    return (states[..., :, None] - states[..., None, :]).abs()

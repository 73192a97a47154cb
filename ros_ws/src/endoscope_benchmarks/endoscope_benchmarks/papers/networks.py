"""The networks that the first paper compares (Table 3), trained by its recipe (section 3.2)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import WIRES
from endoscope_core.classifier.network import StandardisedTension, TensionCnn, Tensor, nn, torch
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.errors import InputError
from endoscope_core.signals import CALIBRATION_SAMPLES

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class CrossValidation:
    """Accuracy on recordings whose tube configuration was not trained with."""

    accuracy: tuple[float, ...]  # share of right classes of each fold
    # (7, 7): rows are true classes, columns named ones, over all folds.
    confusion: NDArray[np.int64]

    @property
    def mean_accuracy(self) -> float:
        """Share of right classes over all recordings."""
        return float(np.trace(self.confusion) / np.sum(self.confusion))

    @classmethod
    def of(
        cls,
        true_deg: NDArray[np.int64],
        named_deg: NDArray[np.int64],
        folds: Sequence[tuple[Rows, Rows]],
    ) -> 'CrossValidation':
        """Compare true and named classes (R,) in deg over folds of (train, test) rows."""
        confusion = np.zeros((len(CLASSES_DEG), len(CLASSES_DEG)), dtype=np.int64)
        true, named = (np.searchsorted(CLASSES_DEG, x) for x in (true_deg, named_deg))
        np.add.at(confusion, (true, named), 1)
        accuracy = tuple(float(np.mean(true[test] == named[test])) for _, test in folds)
        return cls(accuracy, confusion)


def grouped_folds(
    dataset: CalibrationDataset, seed: int, folds: int = 5
) -> list[tuple[Rows, Rows]]:
    """Rows to train and to test with, of each fold; a tube configuration is on one side only."""
    # Classes are as frequent in every fold.
    classes = np.unique(dataset.class_deg)
    least = min(len(set(dataset.configuration[dataset.class_deg == c])) for c in classes)
    if not 2 <= folds <= least:
        may = f'give 2 to {least} folds' if least >= 2 else 'at least 2 a class are needed'
        raise InputError(
            f'{least} recorded tubes a class do not make {folds} folds: {may}, or make more of '
            'them with `endoscope dataset --n`'
        )
    # Only training divides rows: a node that classifies would load it for nothing, and for seconds.
    from sklearn.model_selection import StratifiedGroupKFold

    splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
    return list(splitter.split(dataset.tension, dataset.class_deg, dataset.configuration))


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


Progress = Callable[[str], None]
Network = TensionCnn | TensionMlp | RecurrencePlotCnn

NETWORKS: dict[str, Callable[[int], Network]] = {
    'mlp': TensionMlp,
    'recurrence_plot_cnn': RecurrencePlotCnn,
    'cnn': TensionCnn,
}
"""Networks for a number of classes, in the order of Table 3 of the first paper."""


@dataclass(frozen=True)
class TrainingSettings:
    """The paper's: batches of 100, 100 epochs, Adam at 5e-4, decayed by 0.96 after each epoch."""

    batch_size: int = 100
    epochs: int = 100
    learning_rate: float = 5e-4
    decay: float = 0.96


def as_input(tension: NDArray[np.float32]) -> Tensor:
    """Tensor (R, 4, N) of tensions (R, N, 4)."""
    return torch.from_numpy(np.ascontiguousarray(np.swapaxes(tension, 1, 2), dtype=np.float32))


def train_network(
    tension: NDArray[np.float32],
    class_deg: NDArray[np.int64],
    seed: int,
    settings: TrainingSettings | None = None,
    kind: str = 'cnn',
) -> Network:
    """One of `NETWORKS`, trained with tensions (R, 9000, 4) in N of classes (R,), to evaluate."""
    # The same seed, of first weights and order of batches, gives the same weights on the same
    # machine.
    settings = settings or TrainingSettings()
    torch.manual_seed(seed)
    torch.use_deterministic_algorithms(True)
    inputs = as_input(tension)
    targets = torch.from_numpy(np.searchsorted(CLASSES_DEG, class_deg))
    network = NETWORKS[kind](len(CLASSES_DEG))
    network.standardise_by(inputs)
    optimiser = torch.optim.Adam(network.parameters(), lr=settings.learning_rate)
    schedule = torch.optim.lr_scheduler.ExponentialLR(optimiser, settings.decay)
    loss = nn.CrossEntropyLoss()
    network.train()
    for _ in range(settings.epochs):
        for batch in torch.randperm(len(inputs)).split(settings.batch_size):
            # Batch normalisation cannot take a batch of one.
            if len(batch) < 2:
                continue
            optimiser.zero_grad()
            loss(network(inputs[batch]), targets[batch]).backward()
            optimiser.step()
        schedule.step()
    network.eval()
    return network


def predict(network: Network, tension: NDArray[np.float32]) -> NDArray[np.float64]:
    """Probabilities (R, classes) of tensions (R, 9000, 4)."""
    with torch.inference_mode():
        return torch.softmax(network(as_input(tension)), dim=1).numpy().astype(np.float64)


def cross_validate(
    dataset: CalibrationDataset,
    seed: int,
    folds: int = 5,
    progress: Progress | None = None,
    settings: TrainingSettings | None = None,
    kind: str = 'cnn',
) -> CrossValidation:
    """Stratified k-fold cross-validation that keeps each tube configuration on one side."""
    named = np.zeros_like(dataset.class_deg)
    split = grouped_folds(dataset, seed, folds)
    for k, (train, test) in enumerate(split):
        network = train_network(
            dataset.tension[train], dataset.class_deg[train], seed + k, settings, kind
        )
        likeliest = np.argmax(predict(network, dataset.tension[test]), axis=1)
        named[test] = np.array(CLASSES_DEG)[likeliest]
        if progress is not None:
            right = np.mean(named[test] == dataset.class_deg[test])
            progress(f'fold {k + 1} of {folds}: {100.0 * right:.1f} % right')
    return CrossValidation.of(dataset.class_deg, named, split)


def use_one_thread() -> None:
    """Train on one core, so that sums are formed in the same order everywhere."""
    torch.set_num_threads(1)

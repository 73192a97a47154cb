"""Training of the tension classifier as the first paper does it (section 3.2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from sklearn.model_selection import StratifiedGroupKFold
from torch import Tensor, nn

from endoscope_core.classifier.tension_cnn import TensionCnn
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset

Progress = Callable[[str], None]


@dataclass(frozen=True)
class TrainingSettings:
    """The paper's: batches of 100, 100 epochs, Adam at 5e-4, decayed by 0.96 after each epoch."""

    batch_size: int = 100
    epochs: int = 100
    learning_rate: float = 5e-4
    decay: float = 0.96


@dataclass(frozen=True)
class CrossValidation:
    """Accuracy on recordings whose tube configuration was not trained with.

    Parameters
    ----------
    accuracy : tuple of float
        Share of right classes of each fold.
    confusion : ndarray of int, shape (7, 7)
        Rows are true classes, columns named ones, over all folds.
    """

    accuracy: tuple[float, ...]
    confusion: NDArray[np.int64]

    @property
    def mean_accuracy(self) -> float:
        """Share of right classes over all recordings."""
        return float(np.trace(self.confusion) / np.sum(self.confusion))


def as_input(tension: NDArray[np.float32]) -> Tensor:
    """Tensor (R, 4, N) of tensions (R, N, 4)."""
    return torch.from_numpy(np.ascontiguousarray(np.swapaxes(tension, 1, 2), dtype=np.float32))


def train_network(
    tension: NDArray[np.float32],
    class_deg: NDArray[np.int64],
    seed: int,
    settings: TrainingSettings | None = None,
) -> TensionCnn:
    """Train a network; the same seed on the same machine gives the same weights.

    Parameters
    ----------
    tension : ndarray, shape (R, 9000, 4)
        N.
    class_deg : ndarray of int, shape (R,)
    seed : int
        Of the first weights and of the order of the batches.
    settings : TrainingSettings, optional

    Returns
    -------
    TensionCnn
        In evaluation mode.
    """
    settings = settings or TrainingSettings()
    torch.manual_seed(seed)
    torch.use_deterministic_algorithms(True)
    inputs = as_input(tension)
    targets = torch.from_numpy(np.searchsorted(CLASSES_DEG, class_deg))
    network = TensionCnn(len(CLASSES_DEG))
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


def predict(network: TensionCnn, tension: NDArray[np.float32]) -> NDArray[np.float64]:
    """Probabilities (R, classes) of tensions (R, 9000, 4)."""
    with torch.inference_mode():
        return torch.softmax(network(as_input(tension)), dim=1).numpy().astype(np.float64)


def cross_validate(
    dataset: CalibrationDataset,
    seed: int,
    folds: int = 5,
    progress: Progress | None = None,
    settings: TrainingSettings | None = None,
) -> CrossValidation:
    """Stratified k-fold cross-validation that keeps each tube configuration on one side.

    Raises
    ------
    ValueError
        If a class has fewer configurations than there are folds.
    """
    accuracy = []
    confusion = np.zeros((len(CLASSES_DEG), len(CLASSES_DEG)), dtype=np.int64)
    splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
    split = splitter.split(dataset.tension, dataset.class_deg, dataset.configuration)
    for k, (train, test) in enumerate(split):
        network = train_network(
            dataset.tension[train], dataset.class_deg[train], seed + k, settings
        )
        named = np.argmax(predict(network, dataset.tension[test]), axis=1)
        true = np.searchsorted(CLASSES_DEG, dataset.class_deg[test])
        np.add.at(confusion, (true, named), 1)
        accuracy.append(float(np.mean(named == true)))
        if progress is not None:
            progress(f'fold {k + 1} of {folds}: {100.0 * accuracy[-1]:.1f} % right')
    return CrossValidation(tuple(accuracy), confusion)


def use_one_thread() -> None:
    """Train on one core, so that sums are formed in the same order everywhere."""
    torch.set_num_threads(1)

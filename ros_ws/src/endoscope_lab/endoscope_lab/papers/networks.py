"""The network of the first paper (Table 3), trained as in its section 3.2."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.errors import InputError
from endoscope_lab.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_lab.training.network import TensionCnn, Tensor, nn, torch

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class CrossValidation:
    """Accuracy on recordings of tube configurations that are not in the training set."""

    accuracy: tuple[float, ...]  # share of right classes of each fold
    # (7, 7): rows are true classes, columns predicted ones, over all folds.
    confusion: NDArray[np.int64]

    @classmethod
    def of(
        cls,
        true_deg: NDArray[np.int64],
        named_deg: NDArray[np.int64],
        folds: Sequence[tuple[Rows, Rows]],
    ) -> 'CrossValidation':
        """Compare true and predicted classes (R,) in deg over folds of (train, test) rows."""
        confusion = np.zeros((len(CLASSES_DEG), len(CLASSES_DEG)), dtype=np.int64)
        true, named = (np.searchsorted(CLASSES_DEG, x) for x in (true_deg, named_deg))
        np.add.at(confusion, (true, named), 1)
        accuracy = tuple(float(np.mean(true[test] == named[test])) for _, test in folds)
        return cls(accuracy, confusion)


def grouped_folds(
    dataset: CalibrationDataset, seed: int, folds: int = 5
) -> list[tuple[Rows, Rows]]:
    """Rows for training and test of each fold; each tube configuration is on one side only."""
    # Stratified: classes are equally frequent in every fold.
    classes = np.unique(dataset.class_deg)
    least = min(len(set(dataset.configuration[dataset.class_deg == c])) for c in classes)
    if not 2 <= folds <= least:
        may = f'give 2 to {least} folds' if least >= 2 else 'at least 2 a class are needed'
        raise InputError(
            f'{least} recorded tubes a class do not make {folds} folds: {may}, or make more of '
            'them with `endoscope dataset --n`'
        )
    # Imported here, since only training needs it, and the import takes seconds.
    from sklearn.model_selection import StratifiedGroupKFold

    splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
    return list(splitter.split(dataset.tension, dataset.class_deg, dataset.configuration))


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
) -> TensionCnn:
    """The network trained on tensions (R, 9000, 4) in N of classes (R,), in evaluation mode."""
    # The same seed (of initial weights and order of batches) gives the same weights on the same
    # machine.
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


def cross_validate(dataset: CalibrationDataset, seed: int, folds: int = 5) -> CrossValidation:
    """Stratified k-fold cross-validation that keeps each tube configuration on one side."""
    named = np.zeros_like(dataset.class_deg)
    split = grouped_folds(dataset, seed, folds)
    for k, (train, test) in enumerate(split):
        network = train_network(dataset.tension[train], dataset.class_deg[train], seed + k)
        likeliest = np.argmax(predict(network, dataset.tension[test]), axis=1)
        named[test] = np.array(CLASSES_DEG)[likeliest]
    return CrossValidation.of(dataset.class_deg, named, split)


def use_one_thread() -> None:
    """Train on one core, so that sums are formed in the same order everywhere."""
    torch.set_num_threads(1)

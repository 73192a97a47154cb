"""Training of the networks of Table 3 as the first paper does it (section 3.2)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_benchmarks.networks.grouped_folds import CrossValidation, grouped_folds
from endoscope_benchmarks.networks.recurrence_plot_cnn import RecurrencePlotCnn
from endoscope_benchmarks.networks.tension_mlp import TensionMlp
from endoscope_core.classifier.network import TensionCnn, Tensor, nn, torch
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset

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
    """Train one of `NETWORKS` with tensions (R, 9000, 4) in N of classes (R,).

    It comes in evaluation mode. The same seed, of first weights and order of batches, gives the
    same weights on the same machine.
    """
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
    """Stratified k-fold cross-validation that keeps each tube configuration on one side.

    InputError as of `grouped_folds`.
    """
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

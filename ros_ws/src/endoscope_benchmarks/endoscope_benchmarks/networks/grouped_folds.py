"""Cross-validation on tube configurations that were not trained with."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.errors import InputError

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
    """Rows to train with and rows to test with, of each fold.

    Classes are as frequent in every fold, and each tube configuration is on one side only.
    InputError if folds are fewer than two, or more than a class has configurations.
    """
    classes = np.unique(dataset.class_deg)
    least = min(len(set(dataset.configuration[dataset.class_deg == c])) for c in classes)
    if not 2 <= folds <= least:
        may = f'give 2 to {least} folds' if least >= 2 else 'at least 2 a class are needed'
        raise InputError(
            f'{folds} folds cannot be made of {least} recorded tubes a class: {may}, or make more '
            'of them with `endoscope dataset --n`'
        )
    # Only training divides rows: a node that classifies would load it for nothing, and for seconds.
    from sklearn.model_selection import StratifiedGroupKFold

    splitter = StratifiedGroupKFold(folds, shuffle=True, random_state=seed)
    return list(splitter.split(dataset.tension, dataset.class_deg, dataset.configuration))

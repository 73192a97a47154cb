"""Fits the size model and measures, on tubes held out from it, how far it is to be trusted."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from endoscope_core.classifier.classification import LEVEL, ClassificationResult
from endoscope_core.classifier.grouped_folds import CrossValidation, Rows, grouped_folds
from endoscope_core.classifier.size_classifier import HeldOutCalibration, SizeClassifier
from endoscope_core.classifier.size_model import SizeEstimate, fitted_size_model
from endoscope_core.classifier.weights_file import SIZE, save_weights
from endoscope_core.dataset import CLASSES_DEG, CalibrationDataset
from endoscope_core.signals import calibration_motion

Array = NDArray[np.float64]
Progress = Callable[[str], None]

TAIL_DEVIATIONS = 5.0
LEAST_MARGIN = math.log(1.5)


@dataclass(frozen=True)
class SizeValidation:
    """How a size classifier does on tube configurations that it was not fitted with.

    Parameters
    ----------
    classes : CrossValidation
    rmse : tuple of float
        Error of the regressed size in rad of each fold.
    coverage : tuple of float
        Share of intervals of each fold that hold the true size. The intervals of a fold are
        calibrated on the others.
    refused : int
        Recordings held out that would have been refused; the classes count them nevertheless.
    error, half_width : ndarray, shape (R,)
        Of the regressed size of each recording held out, and of its interval, in rad.
    """

    classes: CrossValidation
    rmse: tuple[float, ...]
    coverage: tuple[float, ...]
    refused: int
    error: Array
    half_width: Array

    def share_within(self, level: float) -> float:
        """Share of errors inside the intervals that are to hold a share `level` of them."""
        widening = NormalDist().inv_cdf(0.5 + 0.5 * level) / NormalDist().inv_cdf(0.5 + 0.5 * LEVEL)
        return float(np.mean(np.abs(self.error) <= widening * self.half_width))


def train_size_classifier(dataset: CalibrationDataset, seed: int, folds: int = 5) -> SizeClassifier:
    """Classifier fitted to the whole data set and calibrated on its folds.

    Raises
    ------
    DatasetError
        If there are fewer than two folds, or a class has fewer configurations than there are folds.
    """
    return _train(dataset, seed, folds)[0]


def validated_size_classifier(
    dataset: CalibrationDataset, seed: int, folds: int = 5, progress: Progress | None = None
) -> tuple[SizeClassifier, SizeValidation]:
    """Classifier of `train_size_classifier`, and what its folds say of it."""
    classifier, split, held_out = _train(dataset, seed, folds)
    true = dataset.backlash_size
    named = np.zeros_like(dataset.class_deg)
    error, half_width = np.zeros(len(true)), np.zeros(len(true))
    rmse, coverage, refused = [], [], 0
    for k, (train, test) in enumerate(split):
        others = _rows(held_out, train)
        judge = SizeClassifier(
            classifier.model, calibration_of(others, true[train]), CLASSES_DEG, dataset.motion
        )
        estimate = _rows(held_out, test)
        results = judge.results(estimate)
        named[test] = [result.class_deg for result in results]
        refused += sum(bool(reasons) for reasons in judge.reasons_to_refuse(estimate))
        error[test] = estimate.size - true[test]
        half_width[test] = judge.calibration.inflation * estimate.deviation
        rmse.append(float(np.sqrt(np.mean(error[test] ** 2))))
        coverage.append(share_covered(results, dataset.backlash_size[test]))
        if progress is not None:
            right = np.mean(named[test] == dataset.class_deg[test])
            progress(
                f'fold {k + 1} of {folds}: {100.0 * right:.1f} % right, '
                f'{math.degrees(rmse[-1]):.2f} deg rms'
            )
    classes = CrossValidation.of(dataset.class_deg, named, split)
    validation = SizeValidation(classes, tuple(rmse), tuple(coverage), refused, error, half_width)
    return classifier, validation


def save_size_classifier(
    path: str | Path,
    classifier: SizeClassifier,
    dataset: CalibrationDataset,
    validation: SizeValidation,
    command: str,
    seed: int,
) -> None:
    """Write a size classifier and how it was made; parameters as of `save_weights`."""
    own = {
        'intervals_hold': LEVEL,
        'inflation': classifier.calibration.inflation,
        'ceilings': list(classifier.calibration.ceilings),
        'held_out': {
            'size_rmse': list(validation.rmse),
            'interval_coverage': list(validation.coverage),
            'refused': validation.refused,
        },
    }
    model = classifier.model
    state = {each.name: np.asarray(getattr(model, each.name)) for each in fields(model)}
    save_weights(path, state, SIZE, own, dataset, validation.classes, command, seed)


def share_covered(results: list[ClassificationResult], size: Array) -> float:
    """Share of true sizes (R,) in rad that lie in the intervals of the results."""
    return float(np.mean([r.holds(x) for r, x in zip(results, size.tolist(), strict=True)]))


def calibration_of(held_out: SizeEstimate, true: Array) -> HeldOutCalibration:
    """Calibration on estimates of R recordings held out, whose true sizes (R,) in rad are known.

    Intervals: split conformal prediction with errors in units of the model's own deviation
    (Lei et al., J. Am. Stat. Assoc. 113(523), 2018, sections 2.2 and 5.2). Ceilings: logarithms of
    distances are close to normal; tensions are refused from five standard deviations over the mean
    on, and never below one and a half times the mean distance.
    """
    scores = np.sort(np.abs(held_out.size - true) / held_out.deviation)
    rank = min(len(scores), math.ceil((len(scores) + 1) * LEVEL))
    strange = held_out.strangeness
    margin = np.maximum(TAIL_DEVIATIONS * strange.std(axis=0, ddof=1), LEAST_MARGIN)
    return HeldOutCalibration(
        float(scores[rank - 1]), tuple((strange.mean(axis=0) + margin).tolist())
    )


def _train(
    dataset: CalibrationDataset, seed: int, folds: int
) -> tuple[SizeClassifier, list[tuple[Rows, Rows]], SizeEstimate]:
    settled = calibration_motion(dataset.motion).settled
    tension, size = dataset.tension[:, settled:], dataset.joint_size
    split = grouped_folds(dataset, seed, folds)
    # One thread forms its sums in the same order everywhere.
    with threadpool_limits(1, 'blas'):
        model = fitted_size_model(tension, size)
        parts = [
            fitted_size_model(tension[train], size[train]).estimate(tension[test])
            for train, test in split
        ]
    order = np.argsort(np.concatenate([test for _, test in split]))
    held_out = SizeEstimate(
        *(np.concatenate([getattr(part, name) for part in parts])[order] for name in _FIELDS)
    )
    calibration = calibration_of(held_out, dataset.backlash_size)
    return SizeClassifier(model, calibration, CLASSES_DEG, dataset.motion), split, held_out


_FIELDS = ('size', 'deviation', 'strangeness')


def _rows(estimate: SizeEstimate, rows: Rows) -> SizeEstimate:
    return SizeEstimate(*(getattr(estimate, name)[rows] for name in _FIELDS))

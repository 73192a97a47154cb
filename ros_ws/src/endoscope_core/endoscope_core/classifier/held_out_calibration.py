"""Says, on simulated rigs held out from the training, how far the network is to be trusted."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import LEVEL, nearest_class
from endoscope_core.classifier.cnn_classifier import (
    KNOWN,
    CnnClassifier,
    HeldOutCalibration,
    Judgement,
    first,
    logarithm,
    stretched,
)
from endoscope_core.classifier.disturbance import READING_PERIODS, read, read_of_all_kinds
from endoscope_core.dataset import CLASSES_DEG
from endoscope_core.dataset.training_rigs import held_out_rigs

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Report = Callable[[str], None]

INSTRUMENTS = ('recorded instrument', 'nominal slave')
"""Those that the network is to know: the one rigs are off from, and that which is simulated."""


def calibrated(
    weights: Mapping[str, Single],
    motion: str,
    seed: int,
    held_out: int,
    report: Report = lambda _: None,
) -> tuple[CnnClassifier, dict[str, dict[str, float]]]:
    """Calibrate a network on `held_out` rigs, half of them like each instrument that it is to know.

    What is promised holds for each of them (Vovk, Lindsay, Nouretdinov and Gammerman, Mondrian
    confidence machine, 2003): limits are those of the instrument that needs the wider ones.
    """
    unlimited = HeldOutCalibration(1.0, np.inf, np.inf)
    raw = CnnClassifier(weights, unlimited, CLASSES_DEG, motion)
    each = held_out // len(INSTRUMENTS)
    calibrations: list[HeldOutCalibration] = []
    halved: list[HeldOutCalibration] = []
    parts = []
    for share, instrument in enumerate(INSTRUMENTS):
        count = counted(report, f'held out, like the {instrument}')
        rigs = held_out_rigs(seed, each, motion, first(motion), count, float(share))
        judgements = {
            period: _judged(
                raw, read(rigs.tension, np.random.default_rng([seed, 6, share, period]), period)
            )
            for period in READING_PERIODS
        }
        of_all_kinds = _judged(
            raw, read_of_all_kinds(rigs.tension, np.random.default_rng([seed, 8, share]))
        )
        for kept, rows in ((calibrations, slice(None)), (halved, slice(0, None, 2))):
            kept.append(_calibration(judgements, rigs.size, of_all_kinds, rows))
        parts.append((instrument, judgements, rigs.size))
    judge = CnnClassifier(weights, widest(halved), CLASSES_DEG, motion)
    rest = slice(1, None, 2)
    told = {
        f'{instrument}, {1000 // period} Hz': _figures(judge, _rows(j, rest), size[rest])
        for instrument, judgements, size in parts
        for period, j in judgements.items()
    }
    return CnnClassifier(weights, widest(calibrations), CLASSES_DEG, motion), told


def calibration_of(held_out: Judgement, true: Array, of_all_kinds: Judgement) -> HeldOutCalibration:
    """Calibration on recordings of rigs held out, whose true sizes in rad are known.

    Intervals: split conformal prediction with errors in units of the network's own deviation
    (Lei et al., J. Am. Stat. Assoc. 113(523), 2018, sections 2.2 and 5.2). Refusals: of known
    tubes as cells of every quality read them, half of what may be refused for either reason.
    """
    scores = np.sort(np.abs(held_out.size - true) / held_out.deviation)
    rank = min(len(scores), math.ceil((len(scores) + 1) * LEVEL))
    passed = 0.5 * (1.0 + KNOWN)
    ceiling, doubt = (
        float(np.quantile(column, passed, method='higher'))
        for column in (of_all_kinds.distance, of_all_kinds.none)
    )
    return HeldOutCalibration(float(scores[rank - 1]), ceiling, doubt)


def widest(calibrations: Sequence[HeldOutCalibration]) -> HeldOutCalibration:
    """Calibration that holds wherever one of several does: each number the greatest."""
    columns = zip(*(vars(each).values() for each in calibrations), strict=True)
    return HeldOutCalibration(*map(max, columns))


def counted(report: Report, name: str) -> Callable[[int, int], None]:
    """Progress that reports every 500th."""

    def count(done: int, total: int) -> None:
        if done % 500 == 0 or done == total:
            report(f'{name}: {done} of {total}')

    return count


def _judged(classifier: CnnClassifier, readings: Single) -> Judgement:
    parts = [
        classifier.judged(logarithm(stretched(part)))
        for part in np.array_split(readings, max(1, len(readings) // 64))
    ]
    return _joined(parts)


def _joined(parts: list[Judgement]) -> Judgement:
    return Judgement(*(np.concatenate(each) for each in zip(*map(_columns, parts), strict=True)))


def _rows(judgement: Judgement, rows: slice) -> Judgement:
    return Judgement(*(column[rows] for column in _columns(judgement)))


def _columns(judgement: Judgement) -> tuple[Array, ...]:
    return tuple(vars(judgement).values())


def _calibration(
    judgements: dict[int, Judgement], size: Array, of_all_kinds: Judgement, rows: slice
) -> HeldOutCalibration:
    parts = [_rows(judgement, rows) for judgement in judgements.values()]
    return calibration_of(
        _joined(parts), np.tile(size[rows], len(parts)), _rows(of_all_kinds, rows)
    )


def _figures(judge: CnnClassifier, judgement: Judgement, size: Array) -> dict[str, float]:
    results = judge.results(judgement)
    refused = [bool(reason) for reason in judge.reasons_to_refuse(judgement)]
    nearest = [nearest_class(true, CLASSES_DEG) for true in size.tolist()]
    right = [result.class_deg == each for result, each in zip(results, nearest, strict=True)]
    holds = [result.holds(true) for result, true in zip(results, size.tolist(), strict=True)]
    return {
        'nearest_class_right': round(float(np.mean(right)), 4),
        'size_rmse_deg': round(
            float(np.rad2deg(np.sqrt(np.mean((judgement.size - size) ** 2)))), 3
        ),
        'intervals_hold': round(float(np.mean(holds)), 4),
        'refused': round(float(np.mean(refused)), 4),
    }

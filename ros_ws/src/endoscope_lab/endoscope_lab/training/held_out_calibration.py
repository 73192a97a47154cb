"""Calibration of a network's intervals and refusals on rigs held out from its training."""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import LEVEL, nearest_class
from endoscope_core.classifier.cnn_classifier import (
    KNOWN,
    CnnClassifier,
    Estimates,
    HeldOutCalibration,
    first,
    logarithm,
    stretched,
)
from endoscope_lab.dataset import CLASSES_DEG
from endoscope_lab.dataset.training_rigs import held_out_rigs

Single = NDArray[np.float32]
Generator = np.random.Generator

READING_PERIODS = (1, 2, 5, 10)
"""Intervals between readings, ms."""
NOISE, ZERO, GAIN = 0.02, 0.02, 0.01
"""Good cells: rms noise of a reading in N, standard deviations of zeros in N and of gains."""
_POOR = 0.3
_POORER = 5.0
Array = NDArray[np.float64]
Report = Callable[[str], None]

INSTRUMENTS = ('recorded instrument', 'nominal slave')
"""Instruments that the network must know: the recorded one, and the one that is simulated."""


def read(
    tension: Single, generator: Generator, period: int = 1, zero: float = 0.0, gain: float = 0.0
) -> Single:
    """Readings of noise-free tensions (R, N, 4) in N at 1 kHz, one each `period` ms.

    `zero` and `gain` are standard deviations of the cells' zero errors in N and relative gain
    errors; readings are joined by straight lines at 1 kHz.
    """
    recordings, samples, wires = tension.shape
    cells = (recordings, 1, wires)
    shift = zero * generator.standard_normal(cells, np.float32)
    factor = 1.0 + gain * generator.standard_normal(cells, np.float32)
    begin = -int(generator.integers(period))
    stamps = np.arange(begin, samples + period, period)
    found = tension[:, np.clip(stamps, 0, samples - 1)] * factor + shift
    found += np.float32(NOISE) * generator.standard_normal(found.shape, np.float32)
    if period == 1:
        return found[:, :samples]
    left, rest = np.divmod(np.arange(samples) - begin, period)
    share = (rest / period).astype(np.float32)[:, None]
    return found[:, left] * (1.0 - share) + found[:, left + 1] * share


def read_of_all_kinds(tension: Single, generator: Generator) -> Single:
    """Readings (R, N, 4) by cells of every quality and rate, with one period for each part.

    Three of ten recordings are of poor cells, with five times the errors of zero and gain.
    """
    found = np.empty_like(tension)
    parts = np.array_split(np.arange(len(tension)), len(READING_PERIODS))
    for part, period in zip(parts, READING_PERIODS, strict=True):
        poor = generator.random(len(part)) < _POOR
        for rows, worse in ((part[~poor], 1.0), (part[poor], _POORER)):
            found[rows] = read(tension[rows], generator, period, worse * ZERO, worse * GAIN)
    return found


def exchanged_in_a_joint(tension: Single, generator: Generator) -> Single:
    """The cables of both cells of a joint are exchanged."""
    first = 2 * int(generator.integers(tension.shape[1] // 2))
    order = np.arange(tension.shape[1])
    order[[first, first + 1]] = first + 1, first
    return tension[:, order]


def exchanged_across_joints(tension: Single, generator: Generator) -> Single:
    """The cables of one cell of each joint are exchanged."""
    x, y = int(generator.integers(2)), 2 + int(generator.integers(2))
    order = np.arange(tension.shape[1])
    order[[x, y]] = y, x
    return tension[:, order]


def unplugged(tension: Single, generator: Generator) -> Single:
    """One cell reads zero."""
    found, wire = tension.copy(), _wire(tension, generator)
    found[:, wire] = 0.0
    return found


def stuck(tension: Single, generator: Generator) -> Single:
    """One cell keeps one of its readings."""
    found, wire = tension.copy(), _wire(tension, generator)
    found[:, wire] = found[int(generator.integers(len(found))), wire]
    return found


def clipped(tension: Single, generator: Generator) -> Single:
    """One cell clips at 60 to 90 % of the largest tension of its wire."""
    found, wire = tension.copy(), _wire(tension, generator)
    limit = generator.uniform(0.6, 0.9) * np.max(found[:, wire])
    found[:, wire] = np.minimum(found[:, wire], limit)
    return found


def drifting(tension: Single, generator: Generator, drift: float) -> Single:
    """One cell drifts linearly by `drift` N over the recording, in either direction."""
    found, wire = tension.copy(), _wire(tension, generator)
    sign = generator.choice((-1.0, 1.0))
    found[:, wire] += np.linspace(0.0, sign * drift, len(found), dtype=np.float32)
    return found


def slow(tension: Single, generator: Generator) -> Single:
    """One cell answers with a time constant of 0.15 to 0.5 s."""
    found, wire = tension.copy(), _wire(tension, generator)
    lag = generator.uniform(150.0, 500.0)
    time = np.arange(min(len(found), int(5.0 * lag)))
    kernel = np.exp(-time / lag)
    padded = np.concatenate([np.full(len(time) - 1, found[0, wire]), found[:, wire]])
    spectrum = np.fft.rfft(padded, 2 * len(padded)) * np.fft.rfft(
        kernel / kernel.sum(), 2 * len(padded)
    )
    whole = np.fft.irfft(spectrum, 2 * len(padded))
    found[:, wire] = whole[len(time) - 1 : len(time) - 1 + len(found)]
    return found


def slack(tension: Single, generator: Generator) -> Single:
    """A joint without pretension: both its wires are looser by 2 to 6 N."""
    found = tension.copy()
    first = 2 * int(generator.integers(tension.shape[1] // 2))
    looser = np.float32(generator.uniform(2.0, 6.0))
    found[:, first : first + 2] = np.maximum(found[:, first : first + 2] - looser, 0.0)
    return found


STRANGE: dict[str, Callable[[Single, Generator], Single]] = {
    'exchanged in a joint': exchanged_in_a_joint,
    'unplugged': unplugged,
    'stuck': stuck,
    'clipped at 60 to 90 %': clipped,
    'slow': slow,
    'slack': slack,
}
"""Faults after which tensions (N, 4) in N belong to no tube. Cells exchanged across joints are not
among them, since the joints of an instrument are alike and the size hardly changes; nor is drift,
which a loop that does not close shows by itself."""
SUBTLE = (clipped, slow)
"""Faults that change a recording little; training needs them more often."""


def _wire(tension: Single, generator: Generator) -> int:
    return int(generator.integers(tension.shape[1]))


def calibrated(
    weights: Mapping[str, Single],
    motion: str,
    seed: int,
    held_out: int,
    report: Report = lambda _: None,
) -> tuple[CnnClassifier, dict[str, dict[str, float]]]:
    """Calibrate a network on `held_out` rigs, half of them like each instrument that it must know.

    The coverage holds for each instrument (Vovk, Lindsay, Nouretdinov and Gammerman, Mondrian
    confidence machine, 2003): limits are those of the instrument that needs wider ones.
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
    figures = {
        f'{instrument}, {1000 // period} Hz': _figures(judge, _rows(j, rest), size[rest])
        for instrument, judgements, size in parts
        for period, j in judgements.items()
    }
    return CnnClassifier(weights, widest(calibrations), CLASSES_DEG, motion), figures


def calibration_of(held_out: Estimates, true: Array, of_all_kinds: Estimates) -> HeldOutCalibration:
    """Calibration on recordings of rigs held out, whose true sizes in rad are known.

    Intervals: split conformal prediction with errors in units of the network's own deviation
    (Lei et al., J. Am. Stat. Assoc. 113(523), 2018, sections 2.2 and 5.2). Refusals: of known
    tubes read by cells of every quality, each of two reasons may refuse half of the allowed share.
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
    """Calibration that holds wherever one of several does, with the largest of each number."""
    columns = zip(*(vars(each).values() for each in calibrations), strict=True)
    return HeldOutCalibration(*map(max, columns))


def counted(report: Report, name: str) -> Callable[[int, int], None]:
    """Progress callback that reports every 500th item."""

    def count(done: int, total: int) -> None:
        if done % 500 == 0 or done == total:
            report(f'{name}: {done} of {total}')

    return count


def _judged(classifier: CnnClassifier, readings: Single) -> Estimates:
    parts = [
        classifier.judged(logarithm(stretched(part)))
        for part in np.array_split(readings, max(1, len(readings) // 64))
    ]
    return _joined(parts)


def _joined(parts: list[Estimates]) -> Estimates:
    return Estimates(*(np.concatenate(each) for each in zip(*map(_columns, parts), strict=True)))


def _rows(judgement: Estimates, rows: slice) -> Estimates:
    return Estimates(*(column[rows] for column in _columns(judgement)))


def _columns(judgement: Estimates) -> tuple[Array, ...]:
    return tuple(vars(judgement).values())


def _calibration(
    judgements: dict[int, Estimates], size: Array, of_all_kinds: Estimates, rows: slice
) -> HeldOutCalibration:
    parts = [_rows(judgement, rows) for judgement in judgements.values()]
    return calibration_of(
        _joined(parts), np.tile(size[rows], len(parts)), _rows(of_all_kinds, rows)
    )


def _figures(judge: CnnClassifier, judgement: Estimates, size: Array) -> dict[str, float]:
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

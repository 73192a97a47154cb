"""Calibrations with imperfect load cells, and with cells that are read slowly."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from endoscope_core.calibration import TensionGapError, TensionRecord
from endoscope_core.classifier.classification import (
    ClassificationResult,
    Classifier,
    UnseenTensionError,
    nearest_class,
)
from endoscope_core.classifier.cnn_classifier import (
    CnnClassifier,
    first,
    load_classifier,
    logarithm,
    stretched,
)
from endoscope_core.physics import SensorModel, simulate
from endoscope_core.physics.description import SensorParameters
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion
from endoscope_lab.dataset import CLASSES_DEG
from endoscope_lab.dataset.rig_variation import calibration_command
from endoscope_lab.dataset.training_rigs import training_rigs
from endoscope_lab.papers.row import PapersBench
from endoscope_lab.papers.tracking_trial import configuration_of
from endoscope_lab.training.held_out_calibration import (
    STRANGE,
    drifting,
    exchanged_across_joints,
    read,
)

Array = NDArray[np.float64]
Generator = np.random.Generator

_NEVER_SEEN, _UNSEEN = 848_484, 626_262
_SPREAD_DEG = 1.0
_PART = 64
FAULTS: dict[str, Callable[[NDArray[np.float32], Generator], NDArray[np.float32]]] = {
    **STRANGE,
    **{
        f'drifting by {drift} N in a calibration': partial(drifting, drift=drift)
        for drift in (0.2, 0.5, 1.5)
    },
    'exchanged across joints': exchanged_across_joints,
}
"""Faults of one recording (N, 4), which must be refused or harmless."""
_CELLS: dict[str, dict] = (
    {f'good, read at {1000 // period} Hz': {'period': period} for period in (1, 5, 10)}
    | {f'zero errors of {zero} N (sd)': {'zero': zero} for zero in (0.02, 0.05, 0.1, 0.2, 0.5)}
    | {f'gain errors of {100 * gain:.0f} % (sd)': {'gain': gain} for gain in (0.01, 0.03, 0.1)}
    | {
        f'0.1 N and 3 %, read at {1000 // period} Hz': {'period': period, 'zero': 0.1, 'gain': 0.03}
        for period in (1, 5, 10)
    }
    | {fault: {'fault': fault} for fault in FAULTS}
)
RATES = (100, 125, 200, 250, 450, 500, 990, 1000)
_OTHERWISE_AT = 200
JITTER = 0.2
"""Largest deviation of a reading from its time, as a share of the interval."""
_PERIOD_NS = round(1e9 / CALIBRATION_RATE)
_NO_LIMIT_NS = 1_000_000_000


@dataclass(frozen=True)
class Tubes:
    """R tubes of known size and their tensions without noise, read at 1 kHz from the start."""

    size: Array  # (R,), rad
    tension: NDArray[np.floating]  # (R, N, 4), N
    sensors: tuple[SensorParameters, ...] = ()


def load_cells_text(settings: PapersBench) -> Iterator[str]:
    """A line for each kind of cells: right, wrong and refused by the class nearest to the size."""
    motion = settings.motion
    classifier = load_classifier(settings.weights, motion)
    # Random instruments that were not used in training, with a size within 1 deg of a class.
    tubes = _tubes(
        (
            (
                generator := np.random.default_rng([_NEVER_SEEN, settings.seed, 10 * deg, number]),
                np.deg2rad(deg + _SPREAD_DEG * generator.uniform(-1.0, 1.0)),
            )
            for deg in CLASSES_DEG
            for number in range(settings.tubes)
        ),
        calibration_motion(motion),
    )
    yield f'{motion}, {len(tubes.size)} tubes'
    yield 'cells                                 right   wrong  refused  size: rms    90 % holds'
    for name, case in _CELLS.items():
        yield f'{name:36s} {_as_read(classifier, tubes, settings.seed, **case)}'
    for deg in (30.0, 120.0):
        # Rigs of wide spreads, with a size that rigs of the project hardly have.
        ends = (float(np.deg2rad(deg - 2.0)), float(np.deg2rad(deg + 2.0)))
        begin = first(motion)
        rigs = training_rigs(_NEVER_SEEN + settings.seed, settings.tubes, motion, begin, sizes=ends)
        whole = np.pad(rigs.tension, ((0, 0), (begin, 0), (0, 0)))
        outside = Tubes(rigs.size, whole)
        name = f'good, tubes of {deg:.0f} deg'
        yield f'{name:36s} {_as_read(classifier, outside, settings.seed)}'


def reading_rates_text(settings: PapersBench) -> Iterator[str]:
    """A line for each rate of readings, gap and delay."""
    motion = calibration_motion(settings.motion)
    classifier = load_classifier(settings.weights, motion.name)
    tubes = tubes_of_classes(settings.seed, settings.tubes, motion)
    yield f'{motion.name}, {len(tubes.size)} tubes, each of {len(STRANGE)} strange recordings'
    head = '{:8s} class right  refused  probability: mean, least  size: rms   90 % interval, holds'
    yield head.format('read at') + '  strange refused'
    judge, every = partial(judged_at_rate, classifier, tubes), range(len(tubes.size))
    for rate in RATES:
        refused = [
            judge(k, rate, settings.seed + number, kind=kind) is None
            for kind in STRANGE
            for number, k in enumerate(every[:: len(CLASSES_DEG)])
        ]
        found = [judge(k, rate, settings.seed + k) for k in every]
        yield f'{rate:5d} Hz {_of_rate(found, tubes)}  {100.0 * np.mean(refused):5.1f} %'
    at, seed = _OTHERWISE_AT, settings.seed
    yield head.format('gap')
    for ms in (20, 30, 40, 50, 60):
        found = [judge(k, at, seed + k, gap=1e-3 * ms) for k in every]
        yield f'{ms:5d} ms {_of_rate(found, tubes)}'
    yield head.format('delay')
    for ms in (2, 5, 10, 20):
        found = [judge(k, at, seed + k, delay=1e-3 * ms) for k in every]
        yield f'{ms:5d} ms {_of_rate(found, tubes)}'


def tubes_of_classes(seed: int, each: int, motion: CalibrationMotion) -> Tubes:
    """Tubes that are in no data set, the same ones for every motion."""
    drawn = (
        (np.random.default_rng([_UNSEEN, seed, deg, number]), np.deg2rad(deg))
        for deg in CLASSES_DEG
        for number in range(each)
    )
    return _tubes(drawn, motion)


def _tubes(drawn: Iterator[tuple[Generator, float]], motion: CalibrationMotion) -> Tubes:
    found = [configuration_of(generator, float(size)) for generator, size in drawn]
    tensions = []
    for tube in found:
        moved = simulate(tube.plant, calibration_command(tube.plant, motion))
        tensions.append(moved.tension.reshape(len(moved.time), -1))
    sensors = tuple(tube.plant.sensors for tube in found)
    return Tubes(np.array([tube.backlash_size for tube in found]), np.stack(tensions), sensors)


def _as_read(
    classifier: CnnClassifier,
    tubes: Tubes,
    seed: int,
    *,
    period: int = 1,
    zero: float = 0.0,
    gain: float = 0.0,
    fault: str = '',
) -> str:
    """Classify tubes from readings with a period, zero and gain as in `read`."""
    generator = np.random.default_rng([_NEVER_SEEN, seed, period])
    results: list[ClassificationResult] = []
    refused: list[bool] = []
    for rows in np.array_split(np.arange(len(tubes.size)), max(1, len(tubes.size) // _PART)):
        tension = tubes.tension[rows, first(classifier.motion) :].astype(np.float32)
        if fault:
            tension = np.stack([FAULTS[fault](each, generator) for each in tension])
        courses = logarithm(stretched(read(tension, generator, period, zero, gain)))
        judgement = classifier.judged(courses)
        results += classifier.results(judgement)
        refused += [bool(reason) for reason in classifier.reasons_to_refuse(judgement)]
    known = ~np.array(refused)
    nearest = np.array([nearest_class(size, CLASSES_DEG) for size in tubes.size.tolist()])
    right = np.array([r.class_deg for r in results]) == nearest
    shares = (100.0 * float(np.mean(each)) for each in (right & known, ~right & known, ~known))
    line = '{:5.1f} % {:5.1f} % {:6.1f} %  '.format(*shares)
    if not known.any():
        return line + '     -           -'
    errors = np.array([r.expected_size for r in results]) - tubes.size
    holds = np.array([r.holds(x) for r, x in zip(results, tubes.size.tolist(), strict=True)])
    rmse = np.rad2deg(np.sqrt(np.mean(errors[known] ** 2)))
    return line + f'{rmse:6.2f} deg  {100.0 * np.mean(holds[known]):6.1f} %'


def judged_at_rate(
    classifier: Classifier,
    tubes: Tubes,
    k: int,
    rate: float,
    seed: int,
    *,
    gap: float = 0.0,
    delay: float = 0.0,
    kind: str = '',
) -> ClassificationResult | None:
    """Read tube `k` at a rate of readings per second, resample and classify; None where refused.

    Each reading comes up to `JITTER` of the interval early or late, and is older than its stamp by
    `delay` s. Readings are missing for `gap` s where the tension curves most; a gap of any length
    is bridged. A kind of `STRANGE` spoils the recording first.
    """
    generator = np.random.default_rng([_UNSEEN, seed, round(rate)])
    motion, tension = calibration_motion(classifier.motion), tubes.tension[k]
    if kind:
        tension = STRANGE[kind](tension.astype(np.float32), generator).astype(np.float64)
    interval = 1e9 / rate
    number = np.arange(-1, round(motion.samples * _PERIOD_NS / interval) + 3)
    late = generator.uniform() + generator.uniform(-JITTER, JITTER, len(number))
    stamps = np.round((number + late) * interval)
    if gap:
        begin = _most_bent(tubes.tension[k], motion.settled, round(gap * CALIBRATION_RATE))
        end = begin + round(gap * 1e9)
        stamps = np.concatenate([stamps[stamps < begin], [begin, end], stamps[stamps > end]])
    time = np.arange(motion.samples) * _PERIOD_NS
    true = np.stack([np.interp(stamps - 1e9 * delay, time, wire) for wire in tension.T], axis=1)
    readings = SensorModel(tubes.sensors[k], int(generator.integers(2**31))).tension(true)
    record = TensionRecord(readings.shape[1], 0, _PERIOD_NS, motion.samples, _NO_LIMIT_NS)
    for stamp, each in zip(stamps.tolist(), readings, strict=True):
        record.add(round(stamp), each.tolist())
    try:
        return classifier.classify(record.resampled())
    except (TensionGapError, UnseenTensionError):
        return None


def _most_bent(tension: Array, begin: int, gap: int) -> int:
    """Time in ns at which a straight line over a gap of samples misses the tension most."""
    starts = np.arange(begin, len(tension) - gap)
    middle = tension[starts + gap // 2]
    missed = np.abs(middle - 0.5 * (tension[starts] + tension[starts + gap])) / (middle + 0.5)
    return int(starts[np.argmax(np.max(missed, axis=1))]) * _PERIOD_NS


def _of_rate(found: Sequence[ClassificationResult | None], tubes: Tubes) -> str:
    sizes = [(each, size) for each, size in zip(found, tubes.size.tolist(), strict=True) if each]
    if not sizes:
        return f'none of {len(found)}'
    right = sum(each.class_deg == nearest_class(size, CLASSES_DEG) for each, size in sizes)
    probability = [each.probability for each, _ in sizes]
    error = np.rad2deg([each.size - size for each, size in sizes])
    half = np.rad2deg([np.ptp(each.interval or (0.0, 0.0)) / 2.0 for each, _ in sizes])
    holds = sum(each.holds(size) for each, size in sizes)
    return (
        f'{right:5d} of {len(sizes):3d}  {len(found) - len(sizes):6d}  '
        f'{np.mean(probability):16.3f}, {np.min(probability):.3f}  '
        f'{np.sqrt(np.mean(error**2)):9.2f} deg  {np.mean(half):6.2f} deg, '
        f'{100.0 * holds / len(sizes):5.1f} %'
    )

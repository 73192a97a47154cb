"""`endoscope bench calibration_rate`: what a calibration loses where load cells are read slowly."""

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.calibration import TensionGapError, TensionRecord
from endoscope_core.classifier.classification import (
    ClassificationResult,
    Classifier,
    UnseenTensionError,
)
from endoscope_core.classifier.held_out_calibration import STRANGE
from endoscope_core.classifier.weights_file import load_classifier
from endoscope_core.dataset import CLASSES_DEG, TubeConfiguration
from endoscope_core.dataset.rig_variation import calibration_command
from endoscope_core.physics import SensorModel, simulate
from endoscope_core.signals import (
    CALIBRATION_MOTIONS,
    CALIBRATION_RATE,
    CalibrationMotion,
    calibration_motion,
)
from endoscope_lab.papers.tracking_trial import configuration_of

RATES = (100, 125, 200, 250, 450, 500, 990, 1000)
GAPS_MS = (20, 30, 40, 50, 60)
DELAYS_MS = (2, 5, 10, 20)
OTHERWISE_AT = 200


def run(args: argparse.Namespace) -> int:
    """Measure and print; return 0 if every rate calibrates, else 1."""
    kept = True
    for name in CALIBRATION_MOTIONS:
        classifier = load_classifier(motion=name)
        tubes = tubes_of_all_classes(args.seed, args.tubes, calibration_motion(name))
        print(f'\n{name}, {len(tubes)} tubes, {len(STRANGE) * args.tubes} strange recordings')
        print(_HEAD.format('read at', 'strange refused'))
        for rate in RATES:
            trials = [
                judged_at_rate(classifier, tube, rate, args.seed + k)
                for k, tube in enumerate(tubes)
            ]
            refused = [
                judged_at_rate(classifier, tube, rate, args.seed + k, kind=kind).result is None
                for kind in STRANGE
                for k, tube in enumerate(tubes[:: len(CLASSES_DEG)])
            ]
            print(f'{rate:5d} Hz {_line(trials)}  {100.0 * sum(refused) / len(refused):5.1f} %')
            kept = kept and _kept(trials)
        for what, amounts in (('gap', GAPS_MS), ('delay', DELAYS_MS)):
            print(_HEAD.format(what, ''))
            for amount in amounts:
                trials = [
                    judged_at_rate(
                        classifier,
                        tube,
                        OTHERWISE_AT,
                        args.seed + k,
                        gap=1e-3 * amount if what == 'gap' else 0.0,
                        delay=1e-3 * amount if what == 'delay' else 0.0,
                    )
                    for k, tube in enumerate(tubes)
                ]
                print(f'{amount:5d} ms {_line(trials)}')
    return 0 if kept else 1


_HEAD = '{:8s} class right  refused  probability: mean, least  size: rms   90 % interval, holds  {}'


def _line(trials: list) -> str:
    judged = [t for t in trials if t.result is not None]
    right = sum(t.result.class_deg == t.class_deg for t in judged)
    probability = [t.result.probability for t in judged]
    error = np.rad2deg([t.result.size - t.size for t in judged])
    half = np.rad2deg([np.ptp(t.result.interval) / 2.0 for t in judged])
    holds = sum(t.result.holds(t.size) for t in judged)
    return (
        f'{right:5d} of {len(judged):3d}  {len(trials) - len(judged):6d}  '
        f'{np.mean(probability):16.3f}, {np.min(probability):.3f}  '
        f'{np.sqrt(np.mean(error**2)):9.2f} deg  {np.mean(half):6.2f} deg, '
        f'{100.0 * holds / len(judged):5.1f} %'
    )


def _kept(trials: list) -> bool:
    judged = [t for t in trials if t.result is not None]
    right = all(t.result.class_deg == t.class_deg for t in judged)
    return right and len(trials) - len(judged) <= 0.01 * len(trials)


Array = NDArray[np.float64]

JITTER = 0.2
"""Largest deviation of a reading from its time, as a share of the interval."""

_PERIOD_NS = round(1e9 / CALIBRATION_RATE)
_UNSEEN = 626_262
_NO_LIMIT_NS = 1_000_000_000


@dataclass(frozen=True)
class ReadTube:
    """A tube of one class, and its tensions without noise."""

    class_deg: int
    configuration: TubeConfiguration
    tension: Array  # (N, 4), in N at 1 kHz


@dataclass(frozen=True)
class RateTrial:
    """What became of one calibration."""

    class_deg: int  # true class
    size: float  # true backlash size in rad
    result: ClassificationResult | None  # None where it was refused
    reason: str  # of the refusal


def tubes_of_all_classes(seed: int, per_class: int, motion: CalibrationMotion) -> list[ReadTube]:
    """Tubes that no data set holds; the same seed gives the same ones for every motion."""
    tubes = []
    for class_deg in CLASSES_DEG:
        for number in range(per_class):
            generator = np.random.default_rng([_UNSEEN, seed, class_deg, number])
            found = configuration_of(generator, float(np.deg2rad(class_deg)))
            trajectory = simulate(found.plant, calibration_command(found.plant, motion))
            wires = trajectory.tension.reshape(len(trajectory.time), -1)
            tubes.append(ReadTube(class_deg, found, wires))
    return tubes


def judged_at_rate(
    classifier: Classifier,
    tube: ReadTube,
    rate: float,
    seed: int,
    *,
    gap: float = 0.0,
    delay: float = 0.0,
    kind: str = '',
) -> RateTrial:
    """Read, resample and judge one calibration at a rate of readings a second."""
    # Each comes up to `JITTER` of the interval early or late, and is older than its stamp by
    # `delay` s. There are none for `gap` s where the tension bends most; however long, that is
    # bridged. The seed is that of phase, jitter and noise. A kind of `STRANGE` spoils them first.
    generator = np.random.default_rng([_UNSEEN, seed, round(rate)])
    motion = calibration_motion(classifier.motion)
    tension = tube.tension
    if kind:
        tension = STRANGE[kind](tension.astype(np.float32), generator).astype(np.float64)
    stamps = _stamps(generator, rate, motion)
    if gap:
        begin = _most_bent(tube.tension, motion.settled, round(gap * CALIBRATION_RATE))
        end = begin + round(gap * 1e9)
        stamps = np.concatenate([stamps[stamps < begin], [begin, end], stamps[stamps > end]])
    time = np.arange(motion.samples) * _PERIOD_NS
    true = np.stack([np.interp(stamps - 1e9 * delay, time, wire) for wire in tension.T], axis=1)
    sensors = SensorModel(tube.configuration.plant.sensors, int(generator.integers(2**31)))
    result, reason = _judged(classifier, motion, stamps, sensors.tension(true))
    return RateTrial(tube.class_deg, tube.configuration.backlash_size, result, reason)


def _stamps(generator: np.random.Generator, rate: float, motion: CalibrationMotion) -> Array:
    """Stamps in ns from shortly before the motion to shortly after its record."""
    interval = 1e9 / rate
    number = np.arange(-1, round(motion.samples * _PERIOD_NS / interval) + 3)
    late = generator.uniform() + generator.uniform(-JITTER, JITTER, len(number))
    return np.round((number + late) * interval)


def _most_bent(tension: Array, first: int, gap: int) -> int:
    """Where in ns a straight line over a gap of samples misses the most of the tension."""
    begin = np.arange(first, len(tension) - gap)
    middle = tension[begin + gap // 2]
    missed = np.abs(middle - 0.5 * (tension[begin] + tension[begin + gap])) / (middle + 0.5)
    return int(begin[np.argmax(np.max(missed, axis=1))]) * _PERIOD_NS


def _judged(
    classifier: Classifier, motion: CalibrationMotion, stamps: Array, readings: Array
) -> tuple[ClassificationResult | None, str]:
    record = TensionRecord(readings.shape[1], 0, _PERIOD_NS, motion.samples, _NO_LIMIT_NS)
    for stamp, tension in zip(stamps.tolist(), readings, strict=True):
        record.add(round(stamp), tension.tolist())
    try:
        return classifier.classify(record.resampled()), ''
    except (TensionGapError, UnseenTensionError) as error:
        return None, str(error)

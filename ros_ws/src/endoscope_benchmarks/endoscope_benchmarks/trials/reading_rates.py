"""Calibrations whose load cells are read at other rates than that of the data sets."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_benchmarks.trials.unseen_tubes import UNUSUAL, random_tube
from endoscope_core.calibration import TensionGapError, TensionRecord
from endoscope_core.classifier.classification import (
    ClassificationResult,
    Classifier,
    UnseenTensionError,
)
from endoscope_core.dataset import (
    CLASSES_DEG,
    TubeConfiguration,
    configuration_of_size,
    random_instrument,
)
from endoscope_core.dataset.rig_variation import GREATEST_UNEVENNESS, calibration_command
from endoscope_core.physics import SensorModel, simulate
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion

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
            found = None
            while found is None:
                unevenness = generator.uniform(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS)
                found = configuration_of_size(
                    random_instrument(generator), float(np.deg2rad(class_deg)), unevenness
                )
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
) -> RateTrial:
    """Read, resample and judge one calibration at a rate of readings a second."""
    # Each comes up to `JITTER` of the interval early or late, and is older than its stamp by
    # `delay` s. There are none for `gap` s where the tension bends most; however long, that is
    # bridged. The seed is that of phase, jitter and noise.
    generator = np.random.default_rng([_UNSEEN, seed, round(rate)])
    motion = calibration_motion(classifier.motion)
    stamps = _stamps(generator, rate, motion)
    if gap:
        begin = _most_bent(tube.tension, motion.settled, round(gap * CALIBRATION_RATE))
        end = begin + round(gap * 1e9)
        stamps = np.concatenate([stamps[stamps < begin], [begin, end], stamps[stamps > end]])
    time = np.arange(motion.samples) * _PERIOD_NS
    true = np.stack(
        [np.interp(stamps - 1e9 * delay, time, wire) for wire in tube.tension.T], axis=1
    )
    sensors = SensorModel(tube.configuration.plant.sensors, int(generator.integers(2**31)))
    result, reason = _judged(classifier, motion, stamps, sensors.tension(true))
    return RateTrial(tube.class_deg, tube.configuration.backlash_size, result, reason)


def refused_at_rate(classifier: Classifier, kind: str, rate: float, seed: int) -> bool:
    """Whether tensions of one of the `UNUSUAL` kinds are refused, read at a rate."""
    generator = np.random.default_rng([_UNSEEN, seed, list(UNUSUAL).index(kind)])
    motion = calibration_motion(classifier.motion)
    readings = UNUSUAL[kind](generator, random_tube(generator), motion)
    nearest = np.unique(np.round(_stamps(generator, rate, motion) / _PERIOD_NS).astype(int))
    nearest = nearest[(nearest >= 0) & (nearest < motion.samples)]
    # The record ends with the last of them, as if one more had come.
    stamps = np.append(nearest, motion.samples) * _PERIOD_NS
    return _judged(classifier, motion, stamps, readings[np.append(nearest, nearest[-1])])[0] is None


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

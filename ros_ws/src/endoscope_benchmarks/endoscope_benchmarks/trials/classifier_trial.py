"""How a classifier does on tubes of any size that it has not seen, and on unusual tensions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_benchmarks.trials.unusual_recordings import UNUSUAL
from endoscope_core.classifier.classification import (
    ClassificationResult,
    Classifier,
    UnseenTensionError,
)
from endoscope_core.dataset import random_instrument, record_calibration
from endoscope_core.dataset.rig_variation import (
    GREATEST_UNEVENNESS,
    backlash_sizes,
    in_tube,
)
from endoscope_core.physics import PlantDescription
from endoscope_core.signals import calibration_motion

BENDS = (0.0, float(np.deg2rad(270.0)))
# Data sets draw from the seed alone; this keeps tubes judged on apart from tubes learnt from.
_UNSEEN = 515_151


@dataclass(frozen=True)
class SizeTrial:
    """One tube of any size."""

    size: float  # true backlash size in rad, mean of the joints
    result: ClassificationResult | None  # None where the classifier refused


def random_tube(generator: np.random.Generator) -> PlantDescription:
    """A random rig in a random tube, as data sets hold them, but of any size."""
    instrument = random_instrument(generator)
    unevenness = generator.uniform(-GREATEST_UNEVENNESS, GREATEST_UNEVENNESS)
    return in_tube(instrument, generator.uniform(*BENDS), unevenness)


def judge_unseen_tubes(classifier: Classifier, seed: int, tubes: int) -> list[SizeTrial]:
    """Calibrate and judge tubes of any size; the same seed gives the same tubes."""
    motion = calibration_motion(classifier.motion)
    trials = []
    for number in range(tubes):
        generator = np.random.default_rng([_UNSEEN, seed, number])
        plant = random_tube(generator)
        noise = int(generator.integers(2**31))
        tension = record_calibration(plant, noise, motion).tension
        size = float(np.mean(backlash_sizes(plant)))
        trials.append(SizeTrial(size, _judged(classifier, tension)))
    return trials


def refused_of_kind(classifier: Classifier, kind: str, seed: int, tubes: int) -> list[bool]:
    """Whether tensions of one of the `UNUSUAL` kinds are refused, for each of some tubes."""
    motion = calibration_motion(classifier.motion)
    refused = []
    for number in range(tubes):
        generator = np.random.default_rng([_UNSEEN, seed, list(UNUSUAL).index(kind), number])
        tension = UNUSUAL[kind](generator, random_tube(generator), motion)
        refused.append(_judged(classifier, tension) is None)
    return refused


def _judged(classifier: Classifier, tension: NDArray[np.float64]) -> ClassificationResult | None:
    try:
        return classifier.classify(tension)
    except UnseenTensionError:
        return None

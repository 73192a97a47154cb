"""Tubes of any size that a classifier has not seen, and calibration tensions to be refused."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

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
from endoscope_core.physics import EffectSpec, PlantDescription, SensorModel, simulate
from endoscope_core.rig import shipped_rig
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion, calibration_motion

Array = NDArray[np.float64]
Generator = np.random.Generator


def slack_wires(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    """Both wires of one joint are longer than their pretension takes up."""
    joint = str(generator.choice(list(plant.joints)))
    slack = EffectSpec('wire_slack', joint, {'length_m': generator.uniform(1e-3, 2e-3)})
    return _tension(generator, replace(plant, effects=(*plant.effects, slack)), motion)


def broken_cell(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    """One cell no longer answers to its wire: it stays where it was, or at zero with its noise."""
    tension = _tension(generator, plant, motion)
    wire = generator.integers(tension.shape[1])
    if generator.random() < 0.5:
        tension[:, wire] = tension[0, wire]
    else:
        noise = generator.normal(0.0, plant.sensors.load_cell_noise, len(tension))
        tension[:, wire] = noise
    return tension


def saturated_cell(
    generator: Generator, plant: PlantDescription, motion: CalibrationMotion
) -> Array:
    """One cell clips at 60 to 90 % of what its wire reaches."""
    tension = _tension(generator, plant, motion)
    wire = generator.integers(tension.shape[1])
    limit = generator.uniform(0.6, 0.9) * np.max(tension[:, wire])
    tension[:, wire] = np.minimum(tension[:, wire], limit)
    return tension


def other_motion(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    """The motors did something else: a smaller or slower motion, one joint only, or none."""
    time = np.arange(motion.samples) / CALIBRATION_RATE
    reach = np.ones(len(plant.joints))
    pace = 1.0
    kind = generator.integers(4)
    if kind == 0:
        reach *= generator.uniform(0.4, 0.8)
    elif kind == 1:
        pace = generator.uniform(0.5, 0.8)
    elif kind == 2:
        reach[generator.integers(len(reach))] = 0.0
    else:
        reach *= 0.0
    command = shipped_rig().joints.gear * motion.signal(pace * time)[0][:, None] * reach
    wires = simulate(plant, command).tension.reshape(len(time), -1)
    return SensorModel(plant.sensors, int(generator.integers(2**31))).tension(wires)


def exchanged_cells(
    generator: Generator, plant: PlantDescription, motion: CalibrationMotion
) -> Array:
    """The cables of the two cells of one joint are plugged in the wrong way round."""
    tension = _tension(generator, plant, motion)
    first = 2 * int(generator.integers(tension.shape[1] // 2))
    tension[:, [first, first + 1]] = tension[:, [first + 1, first]]
    return tension


UNUSUAL: dict[str, Callable[[Generator, PlantDescription, CalibrationMotion], Array]] = {
    'slack wires': slack_wires,
    'broken load cell': broken_cell,
    'saturated load cell': saturated_cell,
    'other motion': other_motion,
    'exchanged load cells': exchanged_cells,
}
"""Tensions in N (N, 4) in the order of the data set, by what is unusual about them."""


def _tension(generator: Generator, plant: PlantDescription, motion: CalibrationMotion) -> Array:
    return record_calibration(plant, int(generator.integers(2**31)), motion).tension


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

"""What the tensions of a calibration say of the tube: its class, and the plant of each joint."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.classifier.classification import (
    PLANT_DEVIATION,
    ClassificationResult,
    Classifier,
    UnseenTensionError,
    is_of_a_class,
    of_size,
)
from endoscope_core.control import PhysicalParameters
from endoscope_core.identification.plant_fit import (
    fits_of_calibration,
    lost_pretension,
    plants_of_calibration,
    size_of_explained,
)
from endoscope_core.names import JOINTS
from endoscope_core.signals import CALIBRATION_RATE, CalibrationMotion

# Less is no tenth of a newton in words.
_WORTH_TELLING_N = 0.05


@dataclass(frozen=True)
class Judgement:
    """A tube, as the tensions of one calibration show it."""

    verdict: ClassificationResult
    plants: tuple[PhysicalParameters, ...] = ()  # of each joint; empty where not identified
    # What each joint's wires have lost of their pretension in N, where the plant named the class.
    lost: list[float] | None = None

    def lost_in_words(self) -> str:
        """That the plant named the class, and what wires have lost; empty where it did not."""
        if self.lost is None:
            return ''
        losses = [
            f'{joint} {x:.1f} N'
            for joint, x in zip(JOINTS, self.lost, strict=True)
            if x >= _WORTH_TELLING_N
        ]
        lost = f'; the wires have lost pretension ({", ".join(losses)}): tighten them'
        return ', by the plant: the classifier knows no such tensions' + (lost if losses else '')


def judged(
    classifier: Classifier,
    motion: CalibrationMotion,
    tension: NDArray[np.float64],
    gear: float,
    identify_plant: bool,
) -> Judgement:
    """Judge tensions (N, 4) in N at 1 kHz: by the plant where the classifier knows none such.

    UnseenTensionError where neither explains them.
    """
    command, _ = motion.signal(np.arange(len(tension)) / CALIBRATION_RATE)
    try:
        verdict = classifier.classify(tension)
    except UnseenTensionError:
        if not identify_plant:
            raise
        fits = fits_of_calibration(command, tension, gear)
        size = size_of_explained(fits, gear)
        if size is None or not is_of_a_class(size, classifier.classes_deg):
            raise
        verdict = of_size(size, PLANT_DEVIATION, classifier.classes_deg)
        return Judgement(verdict, tuple(fit.parameters for fit in fits), lost_pretension(fits))
    if not identify_plant:
        return Judgement(verdict)
    return Judgement(verdict, plants_of_calibration(command, tension, gear))

"""What a classifier says of one calibration, and how it refuses."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from endoscope_core.errors import EndoscopeError

WIRE_COUNT = 4
"""Wires whose tensions a classifier reads, in the order x_pos, x_neg, y_pos, y_neg."""
LEVEL = 0.9
"""Share of intervals that are to hold the true size."""
HALF_CLASS = math.radians(5.0)
PLANT_DEVIATION = math.radians(0.9)
"""Rms error in rad of the size by the plant in 23 calibrations of simulated tubes whose wires had
lost up to 1.8 N of pretension."""


class ClassifierError(EndoscopeError, ValueError):
    """Weights that cannot be used, or tensions that are no calibration recording."""


class UnseenTensionError(ClassifierError):
    """Tensions unlike any that the classifier knows: none of its classes."""


@dataclass(frozen=True)
class ClassificationResult:
    """What the classifier says of one calibration."""

    class_deg: int  # the likeliest class: backlash size in deg
    probability: float  # of that class
    probabilities: dict[int, float]  # of each class, by its size in deg; they add up to one
    size: float | None = None  # backlash size in rad, where the classifier regresses it
    # Lower and upper end in rad, which hold the size nine times in ten.
    interval: tuple[float, float] | None = None

    @property
    def expected_size(self) -> float:
        """Backlash size in rad: as regressed, else the mean over the classes."""
        if self.size is not None:
            return self.size
        return float(np.deg2rad(sum(size * p for size, p in self.probabilities.items())))

    def holds(self, size: float) -> bool:
        """Whether a size in rad lies in the interval."""
        return self.interval is not None and self.interval[0] <= size <= self.interval[1]


class Classifier(Protocol):
    """Names the class of a tube from the tensions of one calibration."""

    motion: str
    """Name of the calibration motion whose tensions it reads."""
    classes_deg: tuple[int, ...]
    """Backlash sizes of the classes."""

    def classify(self, tension: ArrayLike) -> ClassificationResult:
        """Class of the tensions (N, 4) in N at 1 kHz from the start of the motion.

        UnseenTensionError where they are like nothing that the classifier knows, ClassifierError
        where they are no recording of the motion.
        """
        ...


def checked_tension(tension: ArrayLike, shape: tuple[int, int]) -> np.ndarray:
    """Tensions as an array; ClassifierError where the shape is another or a value not finite."""
    array: np.ndarray = np.asarray(tension, dtype=np.float64)
    if array.shape != shape:
        raise ClassifierError(f'tensions of a calibration have shape {shape}, not {array.shape}')
    if not np.all(np.isfinite(array)):
        raise ClassifierError('the tensions hold values that are not finite')
    return array


def nearest_class(size: float, classes_deg: Sequence[int]) -> int:
    """Class in deg that is nearest to a backlash size in rad."""
    return min(classes_deg, key=lambda each: abs(math.radians(each) - size))


def is_of_a_class(size: float, classes_deg: Sequence[int]) -> bool:
    """Whether a backlash size in rad is within half a step of 10 deg of a class."""
    nearest = math.radians(nearest_class(size, classes_deg))
    return abs(nearest - size) <= HALF_CLASS


def of_size(
    size: float,
    deviation: float,
    classes_deg: Sequence[int],
    interval: tuple[float, float] | None = None,
) -> ClassificationResult:
    """The class of a tube by its backlash size, known to a standard `deviation`, all in rad."""
    borders = [math.radians(each) - HALF_CLASS for each in classes_deg[1:]]
    likely = NormalDist(size, deviation)
    below = [0.0, *(likely.cdf(border) for border in borders), 1.0]
    each = dict(zip(classes_deg, np.diff(below).tolist(), strict=True))
    nearest = nearest_class(size, classes_deg)
    return ClassificationResult(nearest, each[nearest], each, size, interval)

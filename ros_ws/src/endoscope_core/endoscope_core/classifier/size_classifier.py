"""Names the class of a tube by regressing its backlash size, or says that it is none of them."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.classifier.classification import (
    LEVEL,
    WIRES,
    CellReadings,
    ClassificationResult,
    UnseenTensionError,
    checked_tension,
    result_of,
)
from endoscope_core.classifier.size_model import STRANGENESS, BacklashSizeModel, SizeEstimate
from endoscope_core.signals import calibration_motion

HALF_CLASS = math.radians(5.0)
_NORMAL = NormalDist()


@dataclass(frozen=True)
class HeldOutCalibration:
    """What recordings held out say of the model's own uncertainty.

    Parameters
    ----------
    inflation : float
        Half the width of an interval, in the model's standard deviations.
    ceilings : tuple of float
        Strangeness from which on tensions are unlike any known.
    """

    inflation: float
    ceilings: tuple[float, ...]


class SizeClassifier:
    """A fitted size model, calibrated on tube configurations held out from it.

    It reads the last whole period of the motion only: before that, tensions depend on the motion
    from which the rig was called to its calibration, whose friction has not been wiped out yet.

    Parameters
    ----------
    model : BacklashSizeModel
    calibration : HeldOutCalibration
    classes_deg : tuple of int
        Backlash sizes of the classes in deg.
    motion : str
        Calibration motion whose tensions it reads.
    """

    def __init__(
        self,
        model: BacklashSizeModel,
        calibration: HeldOutCalibration,
        classes_deg: tuple[int, ...],
        motion: str,
    ) -> None:
        self.model = model
        self.calibration = calibration
        self.classes_deg = classes_deg
        self.motion = motion
        recorded = calibration_motion(motion)
        self._samples, self._settled = recorded.samples, recorded.settled

    def classify(
        self, tension: ArrayLike, cells: CellReadings | None = None
    ) -> ClassificationResult:
        """Class, backlash size and interval of one calibration.

        Parameters
        ----------
        tension : array_like, shape (N, 4)
            N at 1 kHz from the start of the motion, wires in the order x_pos, x_neg, y_pos, y_neg.
        cells : CellReadings, optional
            How they were read, where they were not at 1 kHz.

        Raises
        ------
        UnseenTensionError
            If the tensions are unlike any of the data set, or their size is none of its classes.
        ClassifierError
            If the shape is another or a value is not finite.
        """
        array = checked_tension(tension, (self._samples, WIRES))
        estimate = self.model.estimate(array[None, self._settled :], cells)
        reasons = self.reasons_to_refuse(estimate)[0]
        if reasons:
            raise UnseenTensionError(f'none of the classes: {reasons[0]}')
        return self.results(estimate)[0]

    def reasons_to_refuse(self, estimate: SizeEstimate) -> list[list[str]]:
        """Why each of R recordings is none of the classes; an empty list where it may be one."""
        strange = estimate.strangeness > np.array(self.calibration.ceilings)
        reasons = [
            [text for text, too_much in zip(STRANGENESS, row, strict=True) if too_much]
            for row in strange
        ]
        smallest, greatest = self._range
        for found, (low, high) in zip(reasons, self._intervals(estimate), strict=True):
            if low > greatest or high < smallest:
                found.append(
                    f'the backlash size is between {math.degrees(low):.1f} and '
                    f'{math.degrees(high):.1f} deg, outside the {math.degrees(smallest):.0f} to '
                    f'{math.degrees(greatest):.0f} deg of the classes'
                )
        return reasons

    def results(self, estimate: SizeEstimate) -> list[ClassificationResult]:
        """Result for each of R recordings, whether it is to be refused or not."""
        borders = np.deg2rad(self.classes_deg[1:]) - HALF_CLASS
        found = []
        for size, spread, interval in zip(
            estimate.size.tolist(), self._spread(estimate), self._intervals(estimate), strict=True
        ):
            below = [_NORMAL.cdf((border - size) / spread) for border in borders.tolist()]
            weights = np.diff([0.0, *below, 1.0]).tolist()
            found.append(_with_size(result_of(self.classes_deg, weights), size, interval))
        return found

    @property
    def _range(self) -> tuple[float, float]:
        ends = np.deg2rad([self.classes_deg[0], self.classes_deg[-1]])
        return float(ends[0] - HALF_CLASS), float(ends[1] + HALF_CLASS)

    def _spread(self, estimate: SizeEstimate) -> list[float]:
        """Standard deviation in rad of a normal distribution as wide as the intervals."""
        normal = _NORMAL.inv_cdf(0.5 + 0.5 * LEVEL)
        return (self._half_width(estimate) / normal).tolist()

    def _intervals(self, estimate: SizeEstimate) -> list[tuple[float, float]]:
        half = self._half_width(estimate)
        low, high = estimate.size - half, estimate.size + half
        return list(zip(low.tolist(), high.tolist(), strict=True))

    def _half_width(self, estimate: SizeEstimate) -> NDArray[np.float64]:
        return estimate.deviation * self.calibration.inflation


def _with_size(
    result: ClassificationResult, size: float, interval: tuple[float, float]
) -> ClassificationResult:
    return ClassificationResult(
        result.class_deg, result.probability, result.probabilities, size, interval
    )

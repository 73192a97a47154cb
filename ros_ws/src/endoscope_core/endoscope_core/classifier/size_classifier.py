"""Names the class of a tube by regressing its backlash size, or says that it is none of them."""

import math
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from endoscope_core.classifier.classification import (
    LEVEL,
    CellReadings,
    ClassificationResult,
    UnseenTensionError,
    checked_tension,
    result_of,
)
from endoscope_core.classifier.size_model import STRANGENESS, BacklashSizeModel, SizeEstimate
from endoscope_core.classifier.standardised_tension import WIRES
from endoscope_core.signals import calibration_motion

HALF_CLASS = math.radians(5.0)


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
        self.model = model.eval()
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
        with torch.no_grad():
            estimate = self.model(torch.from_numpy(array[self._settled :]).unsqueeze(0), cells)
        reasons = self.reasons_to_refuse(estimate)[0]
        if reasons:
            raise UnseenTensionError(f'none of the classes: {reasons[0]}')
        return self.results(estimate)[0]

    def reasons_to_refuse(self, estimate: SizeEstimate) -> list[list[str]]:
        """Why each of R recordings is none of the classes; an empty list where it may be one."""
        ceilings = torch.tensor(self.calibration.ceilings)
        strange = (estimate.strangeness > ceilings).tolist()
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
        spread = self._spread(estimate)
        borders = torch.tensor(np.deg2rad(self.classes_deg[1:])) - HALF_CLASS
        below = torch.special.ndtr((borders - estimate.size[:, None]) / spread[:, None])
        edges = torch.nn.functional.pad(below, (1, 0), value=0.0)
        weights = torch.diff(torch.nn.functional.pad(edges, (0, 1), value=1.0), dim=1).tolist()
        sizes = estimate.size.tolist()
        return [
            _with_size(result_of(self.classes_deg, row), size, interval)
            for row, size, interval in zip(weights, sizes, self._intervals(estimate), strict=True)
        ]

    @property
    def _range(self) -> tuple[float, float]:
        ends = np.deg2rad([self.classes_deg[0], self.classes_deg[-1]])
        return float(ends[0] - HALF_CLASS), float(ends[1] + HALF_CLASS)

    def _spread(self, estimate: SizeEstimate) -> Tensor:
        """Standard deviation in rad of a normal distribution as wide as the intervals."""
        normal = torch.special.ndtri(torch.tensor(0.5 + 0.5 * LEVEL, dtype=torch.float64))
        return estimate.deviation * self.calibration.inflation / normal

    def _intervals(self, estimate: SizeEstimate) -> list[tuple[float, float]]:
        half = estimate.deviation * self.calibration.inflation
        ends = torch.stack([estimate.size - half, estimate.size + half], dim=1).tolist()
        return [(low, high) for low, high in ends]


def _with_size(
    result: ClassificationResult, size: float, interval: tuple[float, float]
) -> ClassificationResult:
    return ClassificationResult(
        result.class_deg, result.probability, result.probabilities, size, interval
    )

"""What the demonstration does, in order, and what the first paper reports for the same."""

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path


class Method(StrEnum):
    """How the slave is compensated during one run; the name is that of page and terminal."""

    NONE = 'uncompensated'
    BOUC_WEN = 'Bouc-Wen of the class'
    INVERSE = 'physical inverse'


MEANING = {
    Method.NONE: 'the motors do what the tip is asked to do',
    Method.BOUC_WEN: "the first paper's: a hysteresis model of the class that the tube's wire "
    'tensions put it in, inverted',
    Method.INVERSE: 'the friction of this very tube, identified from its wire tensions in the '
    'calibration, inverted',
}

# Parameters of the compensator.
COMPENSATOR = {
    Method.NONE: {'mode': 'none'},
    Method.BOUC_WEN: {'mode': 'bouc_wen', 'selected_by': 'class'},
    Method.INVERSE: {'mode': 'physical', 'selected_by': 'plant'},
}


@dataclass(frozen=True)
class Tube:
    """A shape of the insertion tube."""

    name: str  # colon section of the first paper's experiment (section 4) whose backlash it has
    bend: float  # sum of the tube's bends in that shape, rad; both joints are the recorded family's


@dataclass(frozen=True)
class RecordedRun:
    """One recorded run: a motion tracked by one method, in seconds of the headers' clock."""

    tube: str
    motion: str
    method: Method
    start: float
    end: float


@dataclass(frozen=True)
class CalibrationFacts:
    """What one calibration announced."""

    tube: str
    start: float  # stamp in s at which the sinusoid began
    class_deg: float  # chosen
    probabilities: dict[int, float]  # by class in degrees
    duration: float  # from request to result, s
    reach_deg: tuple[tuple[float, float], ...]  # least and greatest of each joint in this tube


@dataclass(frozen=True)
class RecordedTube:
    """What became of one tube: its bag, what was done when, and what the recorder missed."""

    bag: Path
    segments: tuple[RecordedRun, ...]
    calibration: CalibrationFacts
    lost: dict[str, int]


@dataclass(frozen=True)
class PaperFigure:
    """Mean and standard deviation in degrees, as printed."""

    mean: float
    deviation: float

    def __str__(self) -> str:
        return f'{self.mean:.2f} ± {self.deviation:.2f}'


MOTIONS = ('periodic', 'non_periodic')
MOTION_TITLE = {'periodic': '60 sin t', 'non_periodic': '30 sin t + 30 sin √3 t'}

# Tubes of the recorded family whose backlash under 60 sin(t) deg is that of Table 5 without
# compensation, 50 and 68 deg: by that signal, not by the calibration's.
TUBES = (
    Tube('descending colon', math.radians(50.0)),
    Tube('transverse colon', math.radians(150.0)),
)

# First paper, Table 5: (tube, motion) -> RMSE none, RMSE proposed, backlash none, proposed.
TABLE_5 = {
    (tube, motion): tuple(PaperFigure(*figure) for figure in figures)
    for tube, of_tube in {
        'descending colon': {
            'periodic': ((18.08, 0.35), (4.65, 0.13), (50.02, 1.16), (10.77, 0.48)),
            'non_periodic': ((23.64, 0.08), (6.34, 0.18), (56.88, 1.26), (11.47, 0.71)),
        },
        'transverse colon': {
            'periodic': ((25.95, 0.60), (6.99, 0.65), (68.48, 0.77), (17.05, 0.16)),
            'non_periodic': ((26.78, 0.13), (6.33, 0.18), (70.55, 0.51), (17.68, 0.10)),
        },
    }.items()
    for motion, figures in of_tube.items()
}

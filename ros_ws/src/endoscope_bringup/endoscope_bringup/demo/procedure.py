"""What the demonstration does, in order, and what the first paper reports for the same."""

from dataclasses import dataclass, replace
from enum import StrEnum

from endoscope_core.physics import JointParameters


class Mode(StrEnum):
    """How the slave is compensated during one run."""

    NONE = 'none'
    FEED_FORWARD = 'feed-forward'
    ADAPTIVE = 'adaptive'


@dataclass(frozen=True)
class Tube:
    """A shape of the insertion tube.

    Attributes
    ----------
    name : str
        The colon section of the first paper's experiment (section 4) whose backlash it has.
    joint : JointParameters
        Both joints in that shape.
    """

    name: str
    joint: JointParameters


@dataclass(frozen=True)
class Segment:
    """One recorded run: a motion tracked in one mode, in seconds of the headers' clock."""

    tube: str
    motion: str
    mode: Mode
    start: float
    end: float


@dataclass(frozen=True)
class CalibrationFacts:
    """What one calibration announced.

    Attributes
    ----------
    tube : str
    start : float
        Stamp in s at which the sinusoid began.
    class_deg : float
        Class chosen.
    probabilities : dict of int to float
        By class in degrees.
    duration : float
        Seconds from request to result.
    """

    tube: str
    start: float
    class_deg: float
    probabilities: dict[int, float]
    duration: float


@dataclass(frozen=True)
class PaperFigure:
    """Mean and standard deviation in degrees, as printed."""

    mean: float
    deviation: float

    def __str__(self) -> str:
        return f'{self.mean:.2f} ± {self.deviation:.2f}'


MOTIONS = ('periodic', 'non_periodic')

# `endoscope bench paper_tubes`: the instrument and the two shapes of its tube whose uncompensated
# columns come nearest to those of Table 5.
_INSTRUMENT = JointParameters(
    pretension=5.65,
    pretension_profile=0.618,
    pulley_radius=2.77e-3,
    joint_radius=6.5e-4,
    joint_rest_angle=0.175,
    joint_presliding_spread=0.359,
    joint_damping=6.3e-6,
    motor_bandwidth=29.5,
    friction_profile=(0.009, -0.207, -0.174),
)
TUBES = (
    Tube(
        'descending colon',
        replace(
            _INSTRUMENT,
            capstan_exponent=0.937,
            wire_stiffness=4430.0,
            joint_stiffness=2.87e-3,
            joint_friction=6.41e-4,
            joint_presliding=0.0342,
        ),
    ),
    Tube(
        'transverse colon',
        replace(
            _INSTRUMENT,
            capstan_exponent=1.235,
            wire_stiffness=3815.0,
            joint_stiffness=1.826e-3,
            joint_friction=1.05e-3,
            joint_presliding=0.0269,
        ),
    ),
)

# First paper, Table 5: (tube, motion) -> RMSE none, RMSE proposed, backlash none, proposed.
TABLE_5: dict[tuple[str, str], tuple[PaperFigure, PaperFigure, PaperFigure, PaperFigure]] = {
    ('descending colon', 'periodic'): (
        PaperFigure(18.08, 0.35),
        PaperFigure(4.65, 0.13),
        PaperFigure(50.02, 1.16),
        PaperFigure(10.77, 0.48),
    ),
    ('descending colon', 'non_periodic'): (
        PaperFigure(23.64, 0.08),
        PaperFigure(6.34, 0.18),
        PaperFigure(56.88, 1.26),
        PaperFigure(11.47, 0.71),
    ),
    ('transverse colon', 'periodic'): (
        PaperFigure(25.95, 0.60),
        PaperFigure(6.99, 0.65),
        PaperFigure(68.48, 0.77),
        PaperFigure(17.05, 0.16),
    ),
    ('transverse colon', 'non_periodic'): (
        PaperFigure(26.78, 0.13),
        PaperFigure(6.33, 0.18),
        PaperFigure(70.55, 0.51),
        PaperFigure(17.68, 0.10),
    ),
}

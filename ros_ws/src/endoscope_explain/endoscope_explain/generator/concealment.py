"""What an effect is to the generator: a draw that alters a rig, its readings or its recording."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from endoscope_explain.generator.motions import DURATION, active_span


@dataclass
class ReadingFaults:
    """What is wrong with the sensors and with the recording of one rig; nothing by default.

    Attributes
    ----------
    bias, drift, drift_bow
        Tracker offset (rad), its mean rate (rad/s) and the share of curvature in it, shape (2,).
    distortion
        Amplitude (rad), wave number (1/rad) and phase (rad) of the tracker's error, shape (2, 3).
    tracker_delay
        Seconds by which the tracker is late, shape (2,).
    outlier_share, outlier_size
        Share of tracker poses that are wrong, and by how much at most (rad).
    motor_interference
        Tracker error per motor torque (rad per N m), shape (2,).
    cell_mixing
        What each load cell (row) sees of each wire (column), shape (4, 4).
    cell_drift
        N/s, shape (4,).
    cell_limit
        Reading in N beyond which a cell clips, shape (4,).
    skew
        Relative rate minus one of a device's clock, by device.
    gap
        Device, start (s) and length (s) of what is missing from the recording.
    colour
        Correlation between successive noise samples.
    """

    bias: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    drift: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    drift_bow: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    distortion: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((2, 3)))
    tracker_delay: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    outlier_share: float = 0.0
    outlier_size: float = 0.0
    motor_interference: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(2))
    cell_mixing: npt.NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    cell_drift: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(4))
    cell_limit: npt.NDArray[np.float64] = field(default_factory=lambda: np.full(4, np.inf))
    skew: dict[str, float] = field(default_factory=dict)
    gap: tuple[str, float, float] | None = None
    colour: float = 0.0


@dataclass(frozen=True)
class Peaks:
    """Largest absolute values in one joint of the rig before anything is concealed in it.

    Attributes
    ----------
    shaft_speed
        rad/s.
    torque
        N m; not the peak but what is exceeded in a fiftieth of the time in motion: steps and
        accelerations go beyond.
    tension
        N, of the positive and the negative wire.
    lowest, highest
        Range of the bending angle, rad.
    """

    shaft_speed: float
    torque: float
    tension: tuple[float, float]
    lowest: float
    highest: float


@dataclass
class Setting:
    """Everything a draw may look at and alter.

    Attributes
    ----------
    rng
        Source of all chance.
    strength
        1 is the usual strength of an effect, 0.1 a tenth of it.
    joint
        0 for `bend_x`, 1 for `bend_y`.
    motion
        Kind of the first recording's motion.
    rig, faults
        Altered in place.
    peaks
        Of this joint.
    """

    rng: np.random.Generator
    strength: float
    joint: int
    motion: str
    rig: npt.NDArray[np.void]
    faults: ReadingFaults
    peaks: Peaks

    @property
    def duration(self) -> float:
        """Length of the first recording in seconds."""
        return DURATION[self.motion]

    def put(self, **values: float) -> None:
        """Set fields of this joint's record."""
        for name, value in values.items():
            self.rig[name][self.joint] = value

    def within(self, low: float, high: float) -> float:
        """Draw uniformly."""
        return float(self.rng.uniform(low, high))

    def either_sign(self, low: float, high: float) -> float:
        """Draw a magnitude uniformly and a sign by a fair coin."""
        return self.within(low, high) * (1.0 if self.rng.random() < 0.5 else -1.0)

    def beyond(self, usual_share: float, peak: float) -> float:
        """Limit that `peak` exceeds: usually to `usual_share` of it, a weak one by less."""
        return peak * (1.0 - self.strength * (1.0 - usual_share))

    def moment_in_motion(self) -> float:
        """Time (s) in the middle of what this joint does in the first recording."""
        start, end = active_span(self.motion, self.joint)
        return self.within(start + 0.25 * (end - start), start + 0.7 * (end - start))


Comparable = dict[str, float]


@dataclass(frozen=True)
class Effect:
    """One kind of concealed physics.

    Attributes
    ----------
    id
        Name in the catalogue, or the generator's own for physics outside of it.
    stage
        `actuator`, `transmission`, `joint`, `sensing` or `recording`.
    conceal
        Alters a setting and returns the true values of the comparable parameters.
    source
        Where the functional form comes from.
    of_a_device
        It is a device's that serves both joints, not one joint's.
    """

    id: str
    stage: str
    conceal: Callable[[Setting], Comparable]
    source: str
    of_a_device: bool = False

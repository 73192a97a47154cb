"""What sensors, clocks and recorder make of a rig's noise-free readings.

Noise and quantisation of the sensors; skewed stamps, gaps, single wrong samples. None of this acts
on the rig. Whoever makes samples out of the simulated readings, a sensor's node or `endoscope
simulate`, asks a `SensorModel` for readings, and a `RecordingFaults` for stamps, for samples to
leave out and for samples to spoil, which depend on the time of the sample alone: sample by sample
or all at once makes no difference.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from endoscope_core.compiled import compiled
from endoscope_core.physics.description import SensorParameters

Array = NDArray[np.float64]

TOPICS = ('motor', 'wires', 'tracker')
"""What a gap counts as topic 0, 1 and 2: `motor/measured_js`, `wires/measured_js`, and
the tracker's `slave/measured_js` with `tracker/measured_cp`."""


def quantise(values: ArrayLike, step: float) -> Array:
    """Round to multiples of `step`; a step of zero leaves the values as they are."""
    return _read(values, 0.0, None, step)


class SensorModel:
    """White, independent noise and quantisation of each sensor, reproducible by its seed.

    Each sensor draws from a stream of its own: what one reads does not depend on how often
    another one is asked. Every method takes noise-free values of any shape and returns readings of
    that shape.
    """

    def __init__(self, sensors: SensorParameters, seed: int) -> None:
        self._sensors = sensors
        cells, tracker, effort = np.random.SeedSequence(seed).spawn(3)
        self._cells = np.random.default_rng(cells)
        self._tracker = np.random.default_rng(tracker)
        self._effort = np.random.default_rng(effort)

    def tension(self, tension: ArrayLike) -> Array:
        """Load-cell readings in N."""
        own = self._sensors
        return _read(tension, own.load_cell_noise, self._cells, own.load_cell_resolution)

    def bending(self, angle: ArrayLike) -> Array:
        """Bending angle in rad from the tracker."""
        return _read(angle, self._sensors.tracker_noise, self._tracker, 0.0)

    def shaft_position(self, angle: ArrayLike) -> Array:
        """Encoder reading in rad."""
        return quantise(angle, 2.0 * math.pi / self._sensors.encoder_counts)

    def shaft_velocity(self, speed: ArrayLike) -> Array:
        """Servo's velocity reading in rad/s."""
        return quantise(speed, self._sensors.velocity_resolution)

    def shaft_effort(self, effort: ArrayLike) -> Array:
        """Torque in N m from the servo's current."""
        own = self._sensors
        return _read(effort, own.effort_noise, self._effort, own.effort_resolution)


def _read(
    values: ArrayLike, noise: float, generator: np.random.Generator | None, step: float
) -> Array:
    clean = np.asarray(values, dtype=float)
    white = clean if generator is None else generator.standard_normal(clean.shape)
    readings = np.empty(clean.shape)
    _read_each(clean.ravel(), white.ravel(), noise, step, readings.ravel())
    return readings


@compiled
def _read_each(values: Array, white: Array, noise: float, step: float, readings: Array) -> None:
    # Of a tick's few numbers: each call of numpy costs as much as all of this.
    for k in range(values.size):
        value = values[k] + noise * white[k]
        readings[k] = value if step == 0.0 else np.rint(value / step) * step


@dataclass(frozen=True)
class Gap:
    """A stretch of time without samples of one of `TOPICS`, in s since the start."""

    topic: str
    begin: float
    duration: float


@dataclass(frozen=True)
class Outliers:
    """Wrong samples of one joint's column: their share, and by how many rad they are wrong."""

    column: int
    rate: float
    size: float


@dataclass(frozen=True)
class RecordingFaults:
    """The faults of a rig's clocks and recorder.

    Devices are shared by the joints: a skew or a gap given for one joint befalls all.
    """

    skew: float = 0.0  # relative rate of the tracker's clock, minus one
    gaps: tuple[Gap, ...] = ()
    outliers: tuple[Outliers, ...] = ()

    def joined(self, other: 'RecordingFaults') -> 'RecordingFaults':
        """Both of them together; a ValueError if they disagree about the tracker's one clock."""
        skews = {self.skew, other.skew} - {0.0}
        if len(skews) > 1:
            raise ValueError(
                f'the tracker has one clock: it cannot be fast by {self.skew:g} and {other.skew:g}'
            )
        return RecordingFaults(
            skews.pop() if skews else 0.0,
            self.gaps + other.gaps,
            self.outliers + other.outliers,
        )

    def tracker_time(self, stamp: ArrayLike) -> Array:
        """When the tracker's clock says `stamp`, both in s since the start."""
        return np.asarray(stamp, dtype=np.float64) / (1.0 + self.skew)

    def keeps(self, topic: str, time: ArrayLike) -> NDArray[np.bool_]:
        """Whether samples of a topic, one of `TOPICS`, are recorded at times in s."""
        if topic not in TOPICS:
            raise ValueError(f'there is no topic {topic}: valid are {", ".join(TOPICS)}')
        time = np.asarray(time, dtype=np.float64)
        kept = np.ones(time.shape, dtype=np.bool_)
        for gap in self.gaps:
            if gap.topic == topic:
                kept &= (time < gap.begin) | (time >= gap.begin + gap.duration)
        return kept

    def spoilt(self, bending: ArrayLike, time: ArrayLike, seed: int = 0) -> Array:
        """The tracker's angles (N, J) or (J,) in rad at times in s since the start, with outliers.

        Samples less than 1 us apart count as one; another seed spoils other samples.
        """
        angles = np.array(bending, dtype=np.float64)
        microseconds = np.round(np.asarray(time, dtype=np.float64) * 1e6).astype(np.int64)
        for outlier in self.outliers:
            chance, side = _drawn(microseconds, seed, outlier.column)
            wrong = np.where(side < 0.5, -outlier.size, outlier.size)
            angles[..., outlier.column] += np.where(chance < outlier.rate, wrong, 0.0)
        return angles


def _drawn(microseconds: NDArray[np.int64], seed: int, column: int) -> tuple[Array, Array]:
    """Two uniform numbers in [0, 1) for each sample, by its time alone (splitmix64)."""
    start = ((seed % 2**31) * 2 + column + 1) * 0x9E3779B97F4A7C15 % 2**64
    with np.errstate(over='ignore'):
        key = _mixed(np.array([start], dtype=np.uint64))[0]
        bits = _mixed(key ^ np.asarray(microseconds).astype(np.uint64))
    return (
        (bits >> np.uint64(40)).astype(np.float64) / 2**24,
        (bits & np.uint64(0xFFFF)).astype(np.float64) / 2**16,
    )


def _mixed(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))

"""What one joint's sensors read, on the analysis grid, with the noise known for each sample.

Wires and motor are averaged over `ANALYSIS_PERIOD` (the average is the anti-aliasing filter, and
it acts on simulated readings just the same); the tracker is taken at its own stamps.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from math import pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from endoscope_core.physics import layout
from endoscope_core.physics.description import PlantDescription, SensorParameters
from endoscope_core.physics.on_stamps import hold_on_ticks
from endoscope_core.physics.simulator import TICK
from endoscope_explain.observe.noise import fast_scatter, rounding_error, step_read
from endoscope_explain.recording import (
    QUANTITY_UNITS,
    Array,
    Mask,
    RigRecording,
    Series,
    signal_name,
)

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class StampsOnTicks:
    """Raw samples between ticks, and the analysis samples that they make."""

    # (R,): place of each raw sample between simulated ticks `tick` and `tick + 1`.
    tick: Indices
    share: Array  # (R,), of the way from the one to the other
    first: Indices  # (M,), first raw sample of each analysis sample
    count: Array  # (M,), raw samples in each analysis sample

    def read(self, column: Array, lead: float = 0.0, skew: float = 0.0) -> Array:
        """Analysis samples (M,) of a simulated output (N,); see `Channel.predicted`."""
        if skew == 0.0:
            mean, rise = self._of_ticks
            rows = column[: mean.shape[1]]
            return np.asarray(mean @ rows + lead * (rise @ rows))
        place = (self.tick + self.share) / (1.0 + skew) + lead
        place = np.clip(place, 0.0, len(column) - 1.001)
        tick = place.astype(np.int64)
        left = column[tick]
        raw = left + (place - tick) * (column[tick + 1] - left)
        return np.asarray(np.add.reduceat(raw, self.first) / self.count)

    @cached_property
    def _of_ticks(self) -> tuple[csr_array, csr_array]:
        """Analysis samples from ticks (M, N), and by how much they rise over a tick."""
        sample = np.repeat(np.arange(len(self.first)), self.count.astype(np.int64))
        part = 1.0 / self.count[sample]
        shape = (len(self.first), int(self.tick.max()) + 2)

        def at(values: Array, ticks: Indices) -> csr_array:
            return csr_array((values, (sample, ticks)), shape)

        here, after = at(part, self.tick), at(part, self.tick + 1)
        late = at(part * self.share, self.tick + 1) - at(part * self.share, self.tick)
        return here + late, after - here

    def coarser(self, factor: int) -> 'StampsOnTicks':
        """The same samples between ticks that are longer by a factor."""
        if factor not in self._coarser:
            place = (self.tick + self.share) / factor
            tick = place.astype(np.int64)
            self._coarser[factor] = StampsOnTicks(tick, place - tick, self.first, self.count)
        return self._coarser[factor]

    @cached_property
    def _coarser(self) -> dict[int, 'StampsOnTicks']:
        return {}


ANALYSIS_PERIOD = 0.01
"""Length in s over which fast channels are averaged: 100 Hz, ten times the servo's bandwidth."""


@dataclass(frozen=True)
class Channel:
    """Readings of one sensor on the analysis grid."""

    # Name as the report writes it, series of the recording, SI unit.
    signal: str
    quantity: str
    unit: str
    output: int  # column of the compiled physics' output that this sensor reads
    stamps: StampsOnTicks
    # (M,), stamp in s from the first command, reading, and its known noise (rms).
    time: Array
    value: Array
    noise: Array
    # Part (rms) of the noise that a mean over readings does not lessen: of rounding, and of what a
    # plant never explained of the healthy rig.
    lasting: float = 0.0

    def predicted(self, outputs: Array, lead: float = 0.0, skew: float = 0.0) -> Array:
        """The analysis samples (M,) that simulated outputs (N, OUTPUTS) predict."""
        # `lead` in [0, 1] is by how many ticks a reading is younger than its stamp: a loop
        # that stamps, commands and then reads has a lead of up to one tick. `skew` is by how much
        # the device's clock runs fast.
        return self.stamps.read(outputs[:, self.output], lead, skew)


@dataclass(frozen=True)
class JointRestart:
    """A `Restart` of one joint."""

    tick: int  # of its first command
    way: Array  # (K,), rad
    speed: float  # rad/s


@dataclass(frozen=True)
class JointObservation:
    """One joint's input and channels."""

    joint: str
    inputs: Array  # (1, N, INPUTS), input of the compiled physics on ticks
    # (K,), shaft angles in rad to which the motor has gone one after the other; the last is its
    # own.
    start: Array
    channels: tuple[Channel, ...]
    tick: float = TICK  # in s
    start_speed: float = 0.0  # of the motor at first, rad/s
    restarts: tuple[JointRestart, ...] = ()

    @property
    def size(self) -> int:
        """Number of analysis samples of all channels."""
        return sum(len(channel.time) for channel in self.channels)

    @property
    def times(self) -> Array:
        """Times (size,) in s of all analysis samples, from the first command."""
        return np.concatenate([channel.time for channel in self.channels])

    @property
    def duration(self) -> float:
        """Length in s."""
        return self.inputs.shape[1] * self.tick

    def coarser(self, factor: int) -> 'JointObservation':
        """The same readings on ticks that are longer by a factor, with the mean command of each."""
        if factor == 1:
            return self
        ticks = -(-self.inputs.shape[1] // factor) + 1
        missing = ticks * factor - self.inputs.shape[1]
        padded = np.concatenate([self.inputs, np.repeat(self.inputs[:, -1:], missing, axis=1)], 1)
        inputs = padded.reshape(1, ticks, factor, layout.INPUTS).mean(axis=2)
        channels = tuple(replace(c, stamps=c.stamps.coarser(factor)) for c in self.channels)
        restarts = tuple(replace(each, tick=each.tick // factor) for each in self.restarts)
        tick = factor * self.tick
        return replace(self, inputs=inputs, channels=channels, tick=tick, restarts=restarts)

    def beside(self, other: Array) -> 'JointObservation':
        """The same readings with the other joint's bending angle (N,) in rad on ticks."""
        inputs = self.inputs.copy()
        inputs[0, :, layout.IN_OTHER_JOINT] = other
        return replace(self, inputs=inputs)

    def slices(self) -> tuple[slice, ...]:
        """Place of each channel in a residual vector of all channels."""
        ends = np.cumsum([0, *(len(channel.time) for channel in self.channels)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))


def commanded(recording: RigRecording) -> Array:
    """Shaft commands (N, J) in rad on ticks, from the first one to the recording's end."""
    asked = recording.command
    begin = float(asked.time[0])
    ticks = int(np.ceil((recording.duration - begin) / TICK)) + 2
    return hold_on_ticks(asked.time - begin, asked.values, ticks)


def observe(recording: RigRecording, plant: PlantDescription) -> tuple[JointObservation, ...]:
    """The analysis view of an audited recording, joint by joint, of those that the plant has."""
    begin, held = float(recording.command.time[0]), commanded(recording)
    ticks = len(held)
    joints = []
    for j, joint in enumerate(recording.joints):
        if joint not in plant.joints:
            continue
        inputs = np.zeros((1, ticks, layout.INPUTS))
        inputs[0, :, layout.IN_COMMAND] = held[:, j]
        inputs[0, :, layout.IN_MOTOR] = np.nan
        channels = _channels(recording, j, joint, plant.sensors, begin, ticks)
        start = inputs[0, :1, layout.IN_COMMAND] if recording.start is None else recording.start[j]
        speed = 0.0 if recording.start_speed is None else float(recording.start_speed[j])
        restarts = tuple(
            JointRestart(round((r.time - begin) / TICK), r.way[j], float(r.speed[j]))
            for r in recording.restarts
        )
        joints.append(
            JointObservation(joint, inputs, start, channels, start_speed=speed, restarts=restarts)
        )
    return tuple(joints)


def _channels(
    recording: RigRecording,
    j: int,
    joint: str,
    sensors: SensorParameters,
    begin: float,
    ticks: int,
) -> tuple[Channel, ...]:
    encoder_step = 2.0 * pi / sensors.encoder_counts
    plan = (
        ('shaft_position', 0, layout.OUT_MOTOR, 0.0, encoder_step),
        ('shaft_effort', 0, layout.OUT_EFFORT, sensors.effort_noise, sensors.effort_resolution),
        ('tension', 0, layout.OUT_TENSION_A, sensors.load_cell_noise, sensors.load_cell_resolution),
        ('tension', 1, layout.OUT_TENSION_B, sensors.load_cell_noise, sensors.load_cell_resolution),
        ('bending', 0, layout.OUT_BENDING, sensors.tracker_noise, 0.0),
    )
    measured = recording.measured()
    channels = []
    for quantity, wire, output, white, step in plan:
        if quantity not in measured:
            continue
        time, values = _valid_column(measured[quantity], j, wire, begin, ticks)
        if len(time):
            signal = signal_name(quantity, joint, wire)
            channels.append(_channel(signal, quantity, output, time, values, white, step))
    return tuple(channels)


def _valid_column(
    series: Series, j: int, wire: int, begin: float, ticks: int
) -> tuple[Array, Array]:
    values = series.values[:, j, wire] if series.values.ndim == 3 else series.values[:, j]
    valid = series.valid[:, j, wire] if series.valid.ndim == 3 else series.valid[:, j]
    time = series.time - begin
    use = valid & (time >= 0.0) & (time < (ticks - 1) * TICK)
    return time[use], values[use]


def _channel(
    signal: str,
    quantity: str,
    output: int,
    time: Array,
    values: Array,
    white: float,
    step: float,
) -> Channel:
    step = max(step, step_read(values))
    rounding = rounding_error(step, white)
    white = sqrt(white**2 + step**2 / 12.0 - rounding**2)
    place = time / TICK
    # Stamps on a tick, to the nanosecond, take the tick's own row.
    whole = np.round(place)
    place = np.where(np.abs(place - whole) < 1e-5, whole, place)
    tick = place.astype(np.int64)
    if quantity == 'bending':
        first = np.arange(len(time))
    else:
        block = np.floor(time / ANALYSIS_PERIOD + 1e-6).astype(np.int64)
        first = np.flatnonzero(np.r_[True, np.diff(block) > 0])
    count = np.diff(np.r_[first, len(time)]).astype(float)
    noise = np.sqrt(white**2 / count + rounding**2)
    if quantity == 'tension':
        # Wires slip.
        scatter = np.add.reduceat(fast_scatter(values, white), first) / count
        noise = np.sqrt(noise**2 + scatter**2 / count)
    mean_time = np.add.reduceat(time, first) / count
    mean = np.add.reduceat(values, first) / count
    return Channel(
        signal,
        quantity,
        QUANTITY_UNITS[quantity],
        output,
        StampsOnTicks(tick, place - tick, first, count),
        mean_time,
        mean,
        noise,
        rounding,
    )


SETTLED_S = 0.4
"""Time after the command's last change from which on a joint is at rest."""
LEAST_SAMPLES = 100
LARGEST_FACTOR = 4.0
WHITE = frozenset({'tension', 'bending', 'shaft_effort'})
"""Quantities whose noise is white but for rounding; that of the encoder is rounding alone."""


def with_held_noise(observations: tuple[JointObservation, ...]) -> tuple[JointObservation, ...]:
    """Scale the known noise of each kind of sensor by what is seen in holds."""
    # Coloured noise averages out less than white noise does, and a sensor may be worse than its
    # description. Third differences of the readings in holds show it, without any model.
    # Sensors of one kind are taken together; where there is no hold, the description stands.
    squares: dict[str, list[Array]] = {}
    for observation in observations:
        still = held(observation)
        for channel in observation.channels:
            if channel.quantity in WHITE:
                squares.setdefault(channel.quantity, []).append(_squares(channel, still))
    factors = {}
    for quantity, found in squares.items():
        pooled = np.concatenate(found)
        if len(pooled) >= LEAST_SAMPLES:
            factors[quantity] = float(np.clip(np.sqrt(np.mean(pooled)), 1.0, LARGEST_FACTOR))
    return tuple(
        replace(
            observation,
            channels=tuple(
                replace(c, noise=c.noise * factors.get(c.quantity, 1.0))
                for c in observation.channels
            ),
        )
        for observation in observations
    )


def held(observation: JointObservation) -> Mask:
    """Ticks (N,) at which the command has been constant for `SETTLED_S`."""
    command = observation.inputs[0, :, 0]
    changes = np.flatnonzero(np.diff(command) != 0.0) + 1
    ticks = np.arange(len(command))
    if not len(changes):
        return np.ones(len(command), dtype=bool)
    last = np.searchsorted(changes, ticks, side='right') - 1
    since = ticks - np.where(last >= 0, changes[np.maximum(last, 0)], -len(command))
    return np.asarray(since * TICK > SETTLED_S)


def _squares(channel: Channel, still: Mask) -> Array:
    at_rest = still[channel.stamps.tick[channel.stamps.first]]
    whole = at_rest[:-3] & at_rest[3:]
    regular = np.diff(channel.time)
    even = np.ptp(np.stack([regular[:-2], regular[1:-1], regular[2:]]), axis=0) < 0.5 * np.median(
        regular
    )
    scaled = channel.value / channel.noise
    use = whole & even
    # The mean of the largest squares would be of slips and outliers, not of noise.
    squares = (np.diff(scaled, 3) ** 2 / 20.0)[use]
    return squares[squares < 25.0]

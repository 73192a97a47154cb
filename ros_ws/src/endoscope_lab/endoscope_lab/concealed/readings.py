"""Recordings in memory: sensor readings of a simulated rig, and the misfit of a plant."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics import (
    PlantDescription,
    SensorModel,
    SensorParameters,
    recording_faults,
    simulate,
)
from endoscope_core.physics.sensing import quantise
from endoscope_explain.recording import BENDING, COMMAND, MOTOR, WIRES, RigRecording, Series

Array = NDArray[np.float64]

TRACKER_TICKS = 25
"""Ticks between samples of the tracker: 40 Hz."""
MEAN_OVER = 10
"""Readings of wires and motor that are averaged before they are judged: 10 ms, as in a report."""


@dataclass(frozen=True)
class Noise:
    """Noise of load cells and tracker beyond the description of sensors."""

    # Rms of a slow part (Ornstein-Uhlenbeck), relative to the white noise.
    slow: float = 0.0
    slow_s: float = 2.0  # its correlation time
    # Degrees of freedom of the noise's Student's t distribution, of the same rms; normal if
    # infinite.
    freedom: float = math.inf


@dataclass(frozen=True)
class Readings:
    """Noise-free readings at their stamps in s, for J joints."""

    time: Array  # (N,)
    tracker_time: Array  # (M,)
    command: Array  # (N, J), as are shaft_*
    shaft_position: Array
    shaft_velocity: Array
    shaft_effort: Array
    tension: Array  # (N, J, 2)
    bending: Array  # (M, J)

    def signals(self) -> dict[str, Array]:
        """Readings by the names of a recording's series."""
        names = ('shaft_position', 'shaft_velocity', 'shaft_effort', 'tension', 'bending')
        return {name: getattr(self, name) for name in names}

    def channels(self) -> list[Array]:
        """Shaft angle, effort, both tensions and bending angle of every joint, joint by joint."""
        return [
            column
            for j in range(self.command.shape[1])
            for column in (
                self.shaft_position[:, j],
                self.shaft_effort[:, j],
                self.tension[:, j, 0],
                self.tension[:, j, 1],
                self.bending[:, j],
            )
        ]


def read(plant: PlantDescription, command: Array) -> Readings:
    """Readings of a rig without noise, for motor shaft commands (N, J) in rad, every ms."""
    answer = simulate(plant, command)
    stamps = answer.time[::TRACKER_TICKS]
    # A clock that runs fast stamps earlier readings.
    seen = recording_faults(plant).tracker_time(stamps)
    bending = np.column_stack([np.interp(seen, answer.time, q) for q in answer.bending.T])
    return Readings(
        answer.time,
        stamps,
        command,
        answer.shaft_position,
        answer.shaft_velocity,
        answer.shaft_effort,
        answer.tension,
        bending,
    )


def record(
    plant: PlantDescription, command: Array, seed: int, noise: Noise | None = None
) -> RigRecording:
    """Readings of a rig with the noise of its sensors, as `read`."""
    return as_sensed(read(plant, command), plant.joint_names(), plant.sensors, seed, noise)


def as_sensed(
    clean: Readings,
    joints: tuple[str, ...],
    described: SensorParameters,
    seed: int,
    noise: Noise | None = None,
) -> RigRecording:
    """Readings with the noise and the resolution of described sensors."""
    noise, own = noise or Noise(), described
    if math.isfinite(noise.freedom):
        own = replace(own, load_cell_noise=0.0, tracker_noise=0.0, load_cell_resolution=0.0)
    sensors = SensorModel(own, seed)
    draw = np.random.default_rng([seed, 1])

    def added(like: Array, period: float, rms: float) -> Array:
        return _added(draw, like, period, noise, rms)

    tension = sensors.tension(clean.tension + added(clean.tension, 1e-3, described.load_cell_noise))
    tracker_s = 1e-3 * TRACKER_TICKS
    bending = sensors.bending(
        clean.bending + added(clean.bending, tracker_s, described.tracker_noise)
    )
    return RigRecording(
        'concealed',
        0.0,
        joints,
        Series.of(COMMAND, clean.time, clean.command),
        Series.of(WIRES, clean.time, quantise(tension, described.load_cell_resolution)),
        Series.of(BENDING, clean.tracker_time, bending),
        Series.of(MOTOR, clean.time, sensors.shaft_position(clean.shaft_position)),
        Series.of(MOTOR, clean.time, sensors.shaft_velocity(clean.shaft_velocity)),
        Series.of(MOTOR, clean.time, sensors.shaft_effort(clean.shaft_effort)),
    )


def misfit(plant: PlantDescription, recording: RigRecording, sensors: SensorParameters) -> float:
    """Rmse of a plant's prediction over the noise of the sensors, for the worst signal."""
    predicted = in_noise(read(plant, recording.command.values).signals(), sensors)
    measured = in_noise({k: s.values for k, s in recording.measured().items()}, sensors)
    return worst_rms(np.subtract(*pair) for pair in zip(measured, predicted, strict=True))


def in_noise(signals: Mapping[str, Array], sensors: SensorParameters) -> list[Array]:
    """`Readings.signals` over the sensors' noise, by column, averaged as they are judged."""
    # Without shaft velocity.
    kinds = (
        ('shaft_position', 0.0, 2.0 * math.pi / sensors.encoder_counts),
        ('shaft_effort', sensors.effort_noise, sensors.effort_resolution),
        ('tension', sensors.load_cell_noise, sensors.load_cell_resolution),
        ('bending', sensors.tracker_noise, 0.0),
    )
    columns: list[Array] = []
    for name, white, step in kinds:
        over = 1 if name == 'bending' else MEAN_OVER
        values = signals[name].reshape(len(signals[name]), -1)
        values = values[: len(values) // over * over]
        means = values.reshape(-1, over, values.shape[1]).mean(axis=1)
        # Without white noise, rounding errors are the same in all readings of a mean.
        noise = math.sqrt(white**2 / over + step**2 / 12.0 / (over if white else 1))
        columns += list(means.T / noise)
    return columns


def worst_rms(columns: Iterable[Array]) -> float:
    """Largest rms of the columns."""
    return max(float(np.sqrt(np.mean(column**2))) for column in columns)


def _added(
    draw: np.random.Generator, like: Array, period: float, noise: Noise, rms: float
) -> Array:
    added = np.zeros_like(like)
    if math.isfinite(noise.freedom):
        spread = math.sqrt(noise.freedom / (noise.freedom - 2.0))
        added += rms / spread * draw.standard_t(noise.freedom, like.shape)
    if noise.slow:
        kept = math.exp(-period / noise.slow_s)
        white = math.sqrt(1.0 - kept**2) * draw.standard_normal(like.shape)
        white[0] = draw.standard_normal(like.shape[1:])
        for k in range(1, len(white)):
            white[k] += kept * white[k - 1]
        added += noise.slow * rms * white
    return added

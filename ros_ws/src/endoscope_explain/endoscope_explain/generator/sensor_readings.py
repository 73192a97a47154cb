"""What the concealed rig's sensors and recorder make of its motion."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from endoscope_explain.generator.concealed_physics import TICK, Motion
from endoscope_explain.generator.concealment import ReadingFaults

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]

LOAD_CELL_NOISE = 0.02
LOAD_CELL_STEP = 0.002
TRACKER_NOISE = float(np.radians(0.25))
TRACKER_EVERY = 25
ENCODER_STEP = 2.0 * np.pi / 4096.0
SPEED_STEP = 0.02397
TORQUE_NOISE = 0.0015
TORQUE_STEP = 0.0046
FIRST_STAMP = 1_790_000_000_000_000_000
LEAST_LATENCY = 200_000
LATENCY_SPREAD = 200_000.0

JOINT_NAMES = ('bend_x', 'bend_y')
MOTOR_NAMES = ('motor_x', 'motor_y')
WIRE_NAMES = ('wire_x_pos', 'wire_x_neg', 'wire_y_pos', 'wire_y_neg')


@dataclass(frozen=True)
class Stream:
    """The messages of one topic, all `sensor_msgs/JointState`.

    Attributes
    ----------
    topic
        Relative name.
    names
        Joint names, J of them.
    stamps, log_times
        Nanoseconds, shape (N,).
    position, velocity, effort
        SI units, shape (N, J), or (N, 0) where the topic lacks the field.
    """

    topic: str
    names: tuple[str, ...]
    stamps: Stamps
    log_times: Stamps
    position: Array
    velocity: Array
    effort: Array


def record(
    command: Array, gear: float, motion: Motion, faults: ReadingFaults, rng: np.random.Generator
) -> list[Stream]:
    """Streams of one recording.

    Parameters
    ----------
    command
        Desired bending angle, rad, shape (N, 2).
    gear
        Shaft angle per joint angle in the rig's own drive software.
    motion
        Of N + 1 ticks: a device that is asked in a tick answers at its end.
    faults
        What is wrong with sensors and recording.
    rng
        Source of noise.
    """
    ticks = command.shape[0]
    clock: Array = np.arange(ticks, dtype=np.float64) * TICK
    answered = np.arange(1, ticks + 1)
    tension = _tension(motion.tension[answered], clock, faults, rng)
    torque = motion.torque[answered] + _noise((ticks, 2), TORQUE_NOISE, faults.colour, rng)
    sampled = np.arange(0, ticks, TRACKER_EVERY)
    bending = _bending(motion, sampled, faults, rng)
    empty = np.zeros((ticks, 0))
    all_ticks = np.arange(ticks)
    return [
        _stream('slave/servo_jp', JOINT_NAMES, all_ticks, faults, rng, command, empty, empty),
        _stream(
            'motor/servo_jp', MOTOR_NAMES, all_ticks, faults, rng, command * gear, empty, empty
        ),
        _stream(
            'motor/measured_js',
            MOTOR_NAMES,
            all_ticks,
            faults,
            rng,
            _quantised(motion.shaft_angle[answered], ENCODER_STEP),
            _quantised(motion.shaft_speed[answered], SPEED_STEP),
            _quantised(torque, TORQUE_STEP),
        ),
        _stream('wires/measured_js', WIRE_NAMES, all_ticks, faults, rng, empty, empty, tension),
        _stream(
            'slave/measured_js',
            JOINT_NAMES,
            sampled,
            faults,
            rng,
            bending,
            np.zeros((sampled.size, 0)),
            np.zeros((sampled.size, 0)),
        ),
    ]


def _noise(shape: tuple[int, int], rms: float, colour: float, rng: np.random.Generator) -> Array:
    """Noise of a given rms; with `colour` a first-order autoregression."""
    white = rng.normal(0.0, rms, shape)
    if colour == 0.0:
        return white
    # The first sample is drawn from the stationary distribution like every other.
    driven = np.sqrt(1.0 - colour**2) * white
    driven[0] = white[0]
    return np.asarray(lfilter([1.0], [1.0, -colour], driven, axis=0))


def _quantised(values: Array, step: float) -> Array:
    return np.round(values / step) * step


def _tension(true: Array, clock: Array, faults: ReadingFaults, rng: np.random.Generator) -> Array:
    seen = true @ faults.cell_mixing.T + np.outer(clock, faults.cell_drift)
    seen = seen + _noise((clock.size, 4), LOAD_CELL_NOISE, faults.colour, rng)
    return _quantised(np.minimum(seen, faults.cell_limit), LOAD_CELL_STEP)


def _bending(
    motion: Motion,
    sampled: npt.NDArray[np.int64],
    faults: ReadingFaults,
    rng: np.random.Generator,
) -> Array:
    clock = sampled * TICK
    true_clock = np.arange(motion.bending.shape[0]) * TICK
    seen = np.empty((sampled.size, 2))
    for joint in range(2):
        asked = np.maximum(clock + TICK - faults.tracker_delay[joint], 0.0)
        q = np.interp(asked, true_clock, motion.bending[:, joint])
        amplitude, number, phase = faults.distortion[joint]
        q = q + amplitude * (np.sin(number * q + phase) - np.sin(phase))
        interference = faults.motor_interference[joint]
        q = q + interference * np.interp(asked, true_clock, motion.torque[:, joint])
        span = clock[-1]
        bow = faults.drift_bow[joint] * clock * (clock - span) / span
        seen[:, joint] = q + faults.bias[joint] + faults.drift[joint] * (clock + bow)
    seen += _noise(seen.shape, TRACKER_NOISE, faults.colour, rng)
    wrong = rng.random((sampled.size, 1)) < faults.outlier_share
    size = faults.outlier_size * rng.uniform(0.3, 1.0, seen.shape)
    seen += np.where(wrong, size * rng.choice((-1.0, 1.0), seen.shape), 0.0)
    return seen


def _stream(
    topic: str,
    names: tuple[str, ...],
    ticks: npt.NDArray[np.int64],
    faults: ReadingFaults,
    rng: np.random.Generator,
    position: Array,
    velocity: Array,
    effort: Array,
) -> Stream:
    true = np.asarray(ticks, dtype=np.int64) * round(TICK * 1e9)
    latency = LEAST_LATENCY + np.abs(rng.normal(0.0, LATENCY_SPREAD, true.size)).astype(np.int64)
    stamps = np.round(true * (1.0 + faults.skew.get(topic, 0.0))).astype(np.int64)
    keep = np.ones(true.size, dtype=bool)
    if faults.gap is not None and faults.gap[0] == topic:
        _, begin, length = faults.gap
        keep = (true < begin * 1e9) | (true >= (begin + length) * 1e9)
    return Stream(
        topic,
        names,
        FIRST_STAMP + stamps[keep],
        FIRST_STAMP + (true + latency)[keep],
        position[keep],
        velocity[keep],
        effort[keep],
    )

"""Shaft commands of the recordings: joint angles over time, as an examiner would play them."""

import numpy as np
import numpy.typing as npt

TICK = 1e-3
GEAR = 0.5
DURATION = {'commissioning': 40.0, 'calibration': 9.0, 'second': 12.0}
SECOND_JOINT_STARTS = 24.8
_RESOLUTION = 1e-5

Array = npt.NDArray[np.float64]


def active_span(motion: str, joint: int) -> tuple[float, float]:
    """First and last time (s) at which this joint (0 or 1) moves in a motion."""
    if motion == 'commissioning' and joint == 1:
        return SECOND_JOINT_STARTS, DURATION[motion]
    return 0.0, DURATION[motion]


def joint_command(motion: str, rng: np.random.Generator) -> Array:
    """Desired bending angles at 1 kHz.

    Parameters
    ----------
    motion
        `commissioning`: calibration sinusoid, rest, slow triangle, steps with holds, multisine,
        chirp, teleoperation-like moves, the second joint in the last 40 %. `calibration`: the
        sinusoid alone. `second`: smooth moves of both joints with holds.
    rng
        Source of levels, phases and moves.

    Returns
    -------
    array
        rad, shape (N, 2).

    Raises
    ------
    ValueError
        Unknown motion.
    """
    if motion not in DURATION:
        raise ValueError(f'unknown motion {motion!r}: one of {", ".join(DURATION)}')
    ticks = round(DURATION[motion] / TICK)
    command = np.zeros((ticks, 2))
    time: Array = np.arange(ticks, dtype=np.float64) * TICK
    if motion == 'calibration':
        command[:, 0] = 0.5 * np.pi * np.sin(time)
    elif motion == 'second':
        command[:, 0] = _moves(ticks, np.radians(80.0), 0.0, rng)
        command[:, 1] = _moves(ticks, np.radians(40.0), 0.0, rng)
    else:
        command[:, 0] = _commissioning(ticks, rng)
        turn = 2.0 * np.pi * rng.uniform(0.2, 0.27) * (time - SECOND_JOINT_STARTS)
        command[:, 1] = np.where(time > SECOND_JOINT_STARTS, np.radians(45.0) * np.sin(turn), 0.0)
    return np.round(command / _RESOLUTION) * _RESOLUTION


def _commissioning(ticks: int, rng: np.random.Generator) -> Array:
    peak = np.radians(rng.uniform(62.0, 75.0))
    levels = np.radians(
        [
            rng.uniform(30.0, 50.0),
            -rng.uniform(20.0, 40.0),
            rng.uniform(50.0, 70.0),
            0.0,
        ]
    )
    corners = [
        (9.8, 0.0),
        (10.5, 0.0),
        (12.0, peak),
        (15.0, -peak),
        (16.5, 0.0),
        (16.62, levels[0]),
        (18.0, levels[0]),
        (18.12, levels[1]),
        (19.5, levels[1]),
        (19.62, levels[2]),
        (21.0, levels[2]),
        (21.12, levels[3]),
        (22.5, levels[3]),
    ]
    time: Array = np.arange(ticks, dtype=np.float64) * TICK
    out = np.zeros(ticks)
    sinusoid = time < 9.0
    out[sinusoid] = 0.5 * np.pi * np.sin(time[sinusoid])
    knots = np.array([(9.0, 0.5 * np.pi * np.sin(9.0)), *corners])
    piecewise = (time >= 9.0) & (time < 22.5)
    out[piecewise] = np.interp(time[piecewise], knots[:, 0], knots[:, 1])
    multisine = (time >= 22.5) & (time < 28.0)
    out[multisine] = _multisine(time[multisine] - 22.5, 5.5, rng)
    chirp = (time >= 28.0) & (time < 33.5)
    out[chirp] = _chirp(time[chirp] - 28.0, 5.5)
    moves = time >= 33.5
    out[moves] = _moves(int(moves.sum()), np.radians(60.0), 0.0, rng)
    return out


def _multisine(time: Array, length: float, rng: np.random.Generator) -> Array:
    """Eight random-phase lines with falling amplitude, faded in and out."""
    lines = np.array([1, 2, 3, 4, 5, 7, 9, 12]) / length
    phases = rng.uniform(0.0, 2.0 * np.pi, lines.size)
    waves = np.sin(2.0 * np.pi * np.outer(time, lines) + phases) / np.sqrt(np.arange(1, 9))
    wave = waves.sum(axis=1)
    fade = np.sin(np.pi * np.clip(np.minimum(time, length - time) / 1.0, 0.0, 0.5)) ** 2
    return np.asarray(np.radians(60.0) * fade * wave / np.abs(wave).max())


def _chirp(time: Array, length: float) -> Array:
    """From 0.3 to 3 Hz at 25 deg, ended within a tenth of a second."""
    turn = 2.0 * np.pi * (0.3 * time + 0.5 * (3.0 - 0.3) * time**2 / length)
    fade = np.clip((length - time) / 0.1, 0.0, 1.0)
    return np.asarray(np.radians(25.0) * fade * np.sin(turn))


def _moves(ticks: int, largest: float, start: float, rng: np.random.Generator) -> Array:
    """Minimum-jerk moves (Flash and Hogan 1985) of random size and pace with holds between."""
    out = np.empty(0)
    position = start
    while out.size < ticks:
        target = rng.uniform(-largest, largest)
        distance = abs(target - position)
        pace = rng.uniform(0.5, 1.6)
        s = np.arange(1, max(2, round(max(0.35, distance / pace) / TICK)) + 1, dtype=np.float64)
        s /= s.size
        rise = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
        hold = np.full(round(rng.uniform(0.2, 0.7) / TICK), target)
        out = np.concatenate([out, position + (target - position) * rise, hold])
        position = target
    return out[:ticks]

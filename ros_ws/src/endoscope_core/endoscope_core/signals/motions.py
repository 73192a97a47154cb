"""Motions of both joints by name: those of the papers, and the one for commissioning."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from endoscope_core.signals.calibration_motion import (
    CALIBRATION_AMPLITUDE,
    calibration_sinusoid,
    named,
)
from endoscope_core.signals.signal import FloatArray, Motion, Signal, hold, move, sequence, window

RAMP_DURATION = 1.0
CORNER = 0.1
LOOP = float(np.deg2rad(15.0))
"""Width of a small reversal loop, less than any tube's backlash, rad; corners take some of it."""
HOLD_S = 5.0
"""Wires creep for seconds."""


def sum_of_sines(name: str, components: Sequence[tuple[float, float]], duration: float) -> Signal:
    """Sum of sines, of amplitude (rad) and frequency (rad/s) each, begun and ended by ramps.

    `duration` in s includes both ramps. The `steady` interval leaves out the ramps and
    the first quarter period of the slowest sine, after which the hysteresis no longer depends on
    how the motion began; ValueError if that leaves none.
    """
    quarter = 0.5 * np.pi / min(omega for _, omega in components)
    steady = (max(RAMP_DURATION, quarter), duration - RAMP_DURATION)
    if steady[1] <= steady[0]:
        raise ValueError(
            f'{name}: {duration:g} s are too short, '
            f'give more than {steady[0] + RAMP_DURATION:.3g} s'
        )

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        gain, rate = window(time, duration, RAMP_DURATION, RAMP_DURATION)
        sine = sum((a * np.sin(w * time) for a, w in components), np.zeros_like(time))
        cosine = sum((a * w * np.cos(w * time) for a, w in components), np.zeros_like(time))
        return gain * sine, gain * cosine + rate * sine

    return Signal(name, duration, evaluate, steady)


def periodic_signal(duration: float = 4.5 * np.pi) -> Signal:
    """``60 sin(t)`` deg at 0.159 Hz (1 rad/s), the periodic signal of the first paper."""
    return sum_of_sines('periodic', [(np.deg2rad(60.0), 1.0)], duration)


def non_periodic_signal(duration: float = 25.0) -> Signal:
    """``30 sin(t) + 30 sin(sqrt(3) t)`` deg, the non-periodic signal of the first paper."""
    half = float(np.deg2rad(30.0))
    return sum_of_sines('non_periodic', [(half, 1.0), (half, float(np.sqrt(3.0)))], duration)


def ramps(angles: Sequence[float], speed: float) -> Signal:
    """From the first angle (rad) through all others at constant `speed` (rad/s), corners rounded.

    Constant speed shows friction without inertia or servo lag; a slow one separates creep and
    Stribeck friction from them.
    """
    legs = np.diff(angles)
    knots = np.concatenate(([0.0], np.cumsum(np.abs(legs) / speed))) + 0.5 * CORNER
    slopes = np.concatenate(([0.0], speed * np.sign(legs), [0.0]))
    duration = float(knots[-1] + 0.5 * CORNER)

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle = np.full_like(time, angles[0])
        velocity = np.zeros_like(time)
        for knot, change in zip(knots, np.diff(slopes), strict=True):
            into = np.clip((time - knot) / CORNER + 0.5, 0.0, 1.0)
            beyond = np.maximum(time - knot - 0.5 * CORNER, 0.0)
            velocity += change * into
            angle += change * (0.5 * CORNER * into**2 + beyond)
        return angle, velocity

    return Signal('ramps', duration, evaluate, (0.5 * CORNER, duration - 0.5 * CORNER))


def triangle(amplitude: float, speed: float) -> Signal:
    """One slow triangle 0, +a, -a, 0 (rad) by :func:`ramps`."""
    return replace(ramps((0.0, amplitude, -amplitude, 0.0), speed), name='triangle')


def there_and_back(reach: float, speed: float) -> Signal:
    """A rise and a fall between -+`reach` (rad) by :func:`ramps`, which end where they began.

    40 deg beyond the backlash show both branches, and what depends on the bend.
    """
    return replace(ramps((0.0, reach, -reach, reach, 0.0), speed), name='there and back')


def again_with_hold(reach: float, speed: float) -> Signal:
    """The strokes of :func:`there_and_back` again, a hold, and one small reversal loop.

    Made some time after these, each branch is validated on its second visit. The hold of 5 s
    separates friction, which persists, from relaxation: at one speed they are confounded. It is on
    the way back, because at the end of a stroke an error in the form of a joint stop would weigh on
    all of it. The small loop shows a reversal in the middle of a stroke.
    """
    return sequence(
        'there and back again',
        [
            ramps((0.0, reach, -reach, reach, 0.5 * reach), speed),
            hold(HOLD_S, 0.5 * reach),
            ramps((0.5 * reach, 0.0, LOOP, 0.0), speed),
        ],
    )


def steps_with_holds(angles: tuple[float, ...], rise: float = 0.15, rest: float = 0.6) -> Signal:
    """Quick moves to each angle (rad), then zero, with rests: shows creep, delay and ringing."""
    parts: list[Signal] = []
    here = 0.0
    for target in (*angles, 0.0):
        parts += [move(here, target, rise), hold(rest, target)]
        here = target
    return sequence('steps', parts)


def multisine(amplitude: float, duration: float, lowest: float = 0.2, lines: int = 8) -> Signal:
    """Sines at odd multiples of a base frequency (Hz), `amplitude` rad at most.

    Their amplitudes fall as 1/f; Schroeder phases keep the peak low.
    """
    order = 2 * np.arange(lines) + 1
    omega = 2.0 * np.pi * lowest * order
    phase = -np.pi * np.arange(lines) * (np.arange(lines) + 1) / lines
    weight = 1.0 / order
    grid = np.linspace(0.0, 1.0 / lowest, 2000)
    peak = np.max(np.abs(np.sum(weight * np.sin(grid[:, None] * omega + phase), axis=1)))
    scale = amplitude / peak

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        gain, rate = window(time, duration, 0.5, 0.5)
        argument = time[:, None] * omega + phase
        value = scale * np.sum(weight * np.sin(argument), axis=1)
        slope = scale * np.sum(weight * omega * np.cos(argument), axis=1)
        return gain * value, gain * slope + rate * value

    return Signal('multisine', duration, evaluate, (0.5, duration - 0.5))


def chirp(amplitude: float, duration: float, start: float = 0.2, stop: float = 4.0) -> Signal:
    """Exponential sweep from `start` to `stop` Hz, its amplitude (rad) falling as 1/sqrt(f)."""
    growth = np.log(stop / start) / duration

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        gain, rate = window(time, duration, 0.5, 0.5)
        sweep = np.exp(growth * time)
        argument = 2.0 * np.pi * start * (sweep - 1.0) / growth
        omega = 2.0 * np.pi * start * sweep
        size = amplitude / np.sqrt(sweep)
        value = size * np.sin(argument)
        slope = size * (omega * np.cos(argument) - 0.5 * growth * np.sin(argument))
        return gain * value, gain * slope + rate * value

    return Signal('chirp', duration, evaluate, (0.5, duration - 0.5))


def teleoperation_like(seed: int, reaches: int, reach: float) -> Signal:
    """Minimum-jerk reaches to random angles within +-`reach` rad with pauses, like a hand's."""
    generator = np.random.default_rng(seed)
    parts: list[Signal] = []
    here = 0.0
    for k in range(reaches):
        target = 0.0 if k == reaches - 1 else float(generator.uniform(-reach, reach))
        parts += [
            move(here, target, float(generator.uniform(0.5, 1.1))),
            hold(float(generator.uniform(0.05, 0.4)), target),
        ]
        here = target
    return sequence('teleoperation', parts)


def commissioning_motion(seed: int = 1) -> Motion:
    """Wide strokes, sinusoid, steps, chirp, wide strokes again, teleoperation-like part: 48 s.

    `bend_x` moves alone through the first three pieces, so that whatever appears at `bend_y` then
    is coupling; that makes the wide strokes, a multisine, and the strokes again. They are those of
    :func:`there_and_back` and :func:`again_with_hold`. The teleoperation-like part is drawn from
    `seed`.
    """
    deg = float(np.deg2rad(1.0))
    reach = 70.0 * deg
    once, again = there_and_back(reach, reach), again_with_hold(reach, reach)
    alone = [
        once,
        # As wide as the strokes, each of its own is made again.
        calibration_sinusoid().scaled(reach / CALIBRATION_AMPLITUDE),
        steps_with_holds((40.0 * deg, 70.0 * deg, -10.0 * deg, -60.0 * deg, 20.0 * deg)),
    ]
    x = sequence(
        'commissioning',
        [
            *alone,
            chirp(50.0 * deg, 8.0),
            again,
            teleoperation_like(seed, 8, reach),
        ],
    )
    y = sequence(
        'commissioning',
        [
            hold(sum(part.duration for part in alone)),
            once,
            multisine(60.0 * deg, 6.0),
            again,
            teleoperation_like(seed + 1, 4, reach),
        ],
    )
    return Motion('commissioning', {'bend_x': x, 'bend_y': y})


def both_joints(signal: Signal) -> Motion:
    """The same signal for `bend_x` and `bend_y`."""
    return Motion(signal.name, {'bend_x': signal, 'bend_y': signal})


MOTIONS: dict[str, Callable[[], Motion]] = {
    'calibration': lambda: both_joints(calibration_sinusoid()),
    'periodic': lambda: both_joints(periodic_signal()),
    'non_periodic': lambda: both_joints(non_periodic_signal()),
    'commissioning': commissioning_motion,
}
"""Factory of each motion, by its name."""


def motion_by_name(name: str) -> Motion:
    """Motion of both joints called `name`.

    InputError if there is none of that name; the message names the nearest.
    """
    return named(name, MOTIONS, 'motion')()

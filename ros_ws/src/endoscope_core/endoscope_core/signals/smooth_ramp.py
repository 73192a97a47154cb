"""Minimum-jerk pieces that join rest to motion (Flash and Hogan 1985)."""

from __future__ import annotations

import numpy as np

from endoscope_core.signals.signal import FloatArray, Signal


def smooth_step(phase: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Quintic rise 0 to 1 and its slope, at phases (N,); no speed or acceleration at the ends."""
    s = np.clip(phase, 0.0, 1.0)
    value = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    slope = 30.0 * s**2 * (1.0 - s) ** 2
    return value, slope


def window(
    time: FloatArray, duration: float, rise: float, fall: float
) -> tuple[FloatArray, FloatArray]:
    """Amplitude (N,) that rises smoothly to 1 and falls back, and its rate in 1/s; times in s."""
    up, up_slope = smooth_step(time / rise)
    down, down_slope = smooth_step((duration - time) / fall)
    return up * down, up_slope / rise * down - up * down_slope / fall


def move(start: float, end: float, duration: float) -> Signal:
    """Minimum-jerk move from one angle (rad) to another in `duration` s."""

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        value, slope = smooth_step(time / duration)
        return start + (end - start) * value, (end - start) * slope / duration

    return Signal('move', duration, evaluate, (0.0, duration))


def come_to_rest(angle: float, velocity: float, acceleration: float, duration: float) -> Signal:
    """Quintic from a moving state (rad, rad/s, rad/s^2) to rest at angle zero in `duration` s."""
    t = duration
    system = np.array(
        [
            [t**3, t**4, t**5],
            [3 * t**2, 4 * t**3, 5 * t**4],
            [6 * t, 12 * t**2, 20 * t**3],
        ]
    )
    reached = np.array(
        [
            angle + velocity * t + 0.5 * acceleration * t**2,
            velocity + acceleration * t,
            acceleration,
        ]
    )
    c3, c4, c5 = np.linalg.solve(system, -reached)

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        x = (
            angle
            + velocity * time
            + 0.5 * acceleration * time**2
            + c3 * time**3
            + c4 * time**4
            + c5 * time**5
        )
        v = velocity + acceleration * time + 3 * c3 * time**2 + 4 * c4 * time**3 + 5 * c5 * time**4
        return x, v

    return Signal('come_to_rest', duration, evaluate, (0.0, duration))

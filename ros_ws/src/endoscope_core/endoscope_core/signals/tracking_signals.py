"""The signals on which compensators are judged (first paper, section 4.2 and Table 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from endoscope_core.signals.signal import FloatArray, Signal
from endoscope_core.signals.smooth_ramp import window

RAMP_DURATION = 1.0


def sum_of_sines(
    name: str,
    components: Sequence[tuple[float, float]],
    duration: float,
    ramp: float = RAMP_DURATION,
) -> Signal:
    """Sum of sines whose amplitude rises from and falls to zero.

    Parameters
    ----------
    name : str
        Name of the signal.
    components : sequence of (float, float)
        Amplitude in rad and angular frequency in rad/s of each sine.
    duration : float
        Length in s, ramps included.
    ramp : float
        Length in s of the rise and of the fall.

    Returns
    -------
    Signal
        Its `steady` interval leaves out both ramps and the first quarter period of the slowest
        sine, after which the hysteresis no longer remembers how the motion began.

    Raises
    ------
    ValueError
        If `duration` leaves no steady interval.
    """
    quarter = 0.5 * np.pi / min(omega for _, omega in components)
    steady = (max(ramp, quarter), duration - ramp)
    if steady[1] <= steady[0]:
        raise ValueError(
            f'{name}: {duration:g} s are too short, give more than {steady[0] + ramp:.3g} s'
        )

    def evaluate(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        gain, rate = window(time, duration, ramp, ramp)
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

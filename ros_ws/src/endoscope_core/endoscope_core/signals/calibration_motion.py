"""Motions by which a tube is judged: the first paper's sinusoid and the brief calibration."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from endoscope_core.choices import BRIEF, SINUSOID
from endoscope_core.errors import InputError
from endoscope_core.signals.signal import FloatArray, Signal, come_to_rest, sequence, smooth_step

CALIBRATION_AMPLITUDE = float(np.deg2rad(90.0))
"""Of the calibration sinusoid, rad."""
CALIBRATION_FREQUENCY = 1.0
CALIBRATION_RECORD_DURATION = 9.0
"""Recorded length of the calibration sinusoid, s."""
CALIBRATION_RATE = 1000.0
"""Rate at which it is recorded, Hz."""
CALIBRATION_SAMPLES = 9000
"""Number of recorded samples."""
START_RAMP = 0.5
RETURN_DURATION = 1.0
BRIEF_FREQUENCY = 2.5
BRIEF_RECORD_DURATION = 3.14
_START_RAMP = 0.3
_RETURN_DURATION = 0.7


def calibration_sinusoid() -> Signal:
    """``90 sin(t)`` deg for 9 s, begun smoothly, then brought back to rest at zero within 1 s.

    Its `steady` interval is the last whole period before 9 s.
    """
    # The first paper (section 2.2) uses 0.159 Hz, 1 rad/s: 9 s hold 1.43 periods, so that the last
    # 2 pi s are one whole settled loop (the first peak, at 1.57 s, has wiped out where the motion
    # began). 90 deg drives every class, up to 100 deg, out of its dead zone on both sides. The
    # paper's signal starts with a step in velocity; here its amplitude rises within 0.5 s. The
    # return to zero keeps the whole, 10 s, below the paper's 11 s.
    end = CALIBRATION_RECORD_DURATION
    return begun_sinusoid(
        'calibration',
        CALIBRATION_AMPLITUDE,
        CALIBRATION_FREQUENCY,
        START_RAMP,
        (end - 2.0 * np.pi / CALIBRATION_FREQUENCY, end),
        RETURN_DURATION,
    )


def begun_sinusoid(
    name: str,
    amplitude: float,
    omega: float,
    ramp: float,
    steady: tuple[float, float],
    way_back: float,
) -> Signal:
    """Sine (rad, rad/s) from rest, brought back to rest at zero at last; times in s.

    The amplitude rises smoothly within `ramp`; `steady` is the interval of the result, at whose end
    a way back of length `way_back` begins.
    """

    def rising(time: FloatArray) -> tuple[FloatArray, FloatArray]:
        gain, slope = smooth_step(time / ramp)
        sine = amplitude * np.sin(omega * time)
        cosine = amplitude * omega * np.cos(omega * time)
        return gain * sine, gain * cosine + slope / ramp * sine

    end = steady[1]
    body = Signal('sinusoid', end, rising, steady)
    angle = float(amplitude * np.sin(omega * end))
    velocity = float(amplitude * omega * np.cos(omega * end))
    back = come_to_rest(angle, velocity, -(omega**2) * angle, way_back)
    whole = sequence(name, [body, back])
    return Signal(whole.name, whole.duration, whole.evaluate, steady)


def brief_calibration() -> Signal:
    """``90 sin(2.5 t)`` deg for 3.14 s, begun smoothly, then brought back to zero within 0.7 s.

    Its `steady` interval is the last whole period of the record.
    """
    # The record ends at the second upper peak: from the first to the second the loop is whole and
    # has forgotten where the motion began, as in the first paper's 9 s (section 3.1). Faster motion
    # costs more viscous and servo lag in the tensions, which a model trained on it has seen.
    period = 2.0 * np.pi / BRIEF_FREQUENCY
    return begun_sinusoid(
        'brief calibration',
        CALIBRATION_AMPLITUDE,
        BRIEF_FREQUENCY,
        _START_RAMP,
        (BRIEF_RECORD_DURATION - period, BRIEF_RECORD_DURATION),
        _RETURN_DURATION,
    )


def named[T](name: str, known: Mapping[str, T], what: str) -> T:
    """The motion of a name; InputError, with the nearest, if there is none."""
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.0)
        raise InputError(
            f'unknown {what} {name!r}, nearest is {near[0]!r} (known: {", ".join(known)})'
        )
    return known[name]


@dataclass(frozen=True)
class CalibrationMotion:
    """Motion of a calibration, and the length of its record."""

    name: str
    signal: Signal  # of every joint; it ends at rest at zero, after the record
    samples: int  # samples of the record at 1 kHz, from the start of the signal

    @property
    def settled(self) -> int:
        """First sample of the last whole period, which no longer depends on the start."""
        return math.ceil(self.signal.steady[0] * CALIBRATION_RATE)

    @property
    def amplitude(self) -> float:
        """Largest angle in rad that any joint is sent to, either way, on the way back too."""
        time = np.arange(round(self.signal.duration * CALIBRATION_RATE) + 1) / CALIBRATION_RATE
        return float(np.abs(self.signal(time)[0]).max())


_MOTIONS: dict[str, tuple[Callable[[], Signal], float]] = {
    SINUSOID: (calibration_sinusoid, CALIBRATION_RECORD_DURATION),
    BRIEF: (brief_calibration, BRIEF_RECORD_DURATION),
}


def calibration_motion(name: str = SINUSOID) -> CalibrationMotion:
    """Calibration motion of a name, one of `CALIBRATION_MOTIONS`.

    InputError if there is none of that name; the message names the nearest.
    """
    make, duration = named(name, _MOTIONS, 'calibration motion')
    return CalibrationMotion(name, make(), round(duration * CALIBRATION_RATE))

"""The 9 s motion from which the tube's hysteresis class is read."""

from __future__ import annotations

import numpy as np

from endoscope_core.signals.signal import FloatArray, Signal, sequence
from endoscope_core.signals.smooth_ramp import come_to_rest, smooth_step

CALIBRATION_AMPLITUDE = float(np.deg2rad(90.0))
"""Of the calibration sinusoid, rad."""
CALIBRATION_FREQUENCY = 1.0
CALIBRATION_RECORD_DURATION = 9.0
"""How much of the calibration sinusoid is recorded, s."""
CALIBRATION_RATE = 1000.0
"""Rate at which it is recorded, Hz."""
CALIBRATION_SAMPLES = 9000
"""How many samples of it are recorded."""
START_RAMP = 0.5
RETURN_DURATION = 1.0


def calibration_sinusoid() -> Signal:
    """``90 sin(t)`` deg for 9 s, begun smoothly, then brought back to rest at zero within 1 s.

    The first paper (section 2.2) uses ``90 sin(omega t)`` at 0.159 Hz, which is ``omega = 1``
    rad/s: 9 s hold 1.43 periods, so that the last 2 pi seconds are one whole settled loop (the
    first peak, at 1.57 s, has wiped out where the motion began). 90 deg drives every class, up to
    100 deg of backlash, out of its dead zone on both sides. The paper's signal starts with a step
    in velocity; here its amplitude rises within the first 0.5 s, before anything that the loop
    depends on. The 9000 samples at 1 kHz that the classifier reads are those with ``0 <= t < 9``;
    the return to zero comes after them and keeps the whole, 10 s, below the paper's 11 s.

    Returns
    -------
    Signal
        Its `steady` interval is the last whole period before 9 s.
    """
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

"""A calibration motion of a third of the papers' length."""

from __future__ import annotations

import numpy as np

from endoscope_core.signals.calibration_sinusoid import CALIBRATION_AMPLITUDE, begun_sinusoid
from endoscope_core.signals.signal import Signal

BRIEF_FREQUENCY = 2.5
BRIEF_RECORD_DURATION = 3.14
_START_RAMP = 0.3
_RETURN_DURATION = 0.7


def brief_calibration() -> Signal:
    """``90 sin(2.5 t)`` deg for 3.14 s, begun smoothly, then brought back to zero within 0.7 s.

    The record ends at the second upper peak: from the first peak to the second the loop is whole
    and has forgotten where the motion began, which is what the first paper's 9 s hold at 1 rad/s
    (section 3.1). Faster motion saves time at the cost of more viscous and servo lag in the
    tensions, which a model trained on this motion has seen.

    Returns
    -------
    Signal
        Its `steady` interval is the last whole period of the record.
    """
    period = 2.0 * np.pi / BRIEF_FREQUENCY
    return begun_sinusoid(
        'brief calibration',
        CALIBRATION_AMPLITUDE,
        BRIEF_FREQUENCY,
        _START_RAMP,
        (BRIEF_RECORD_DURATION - period, BRIEF_RECORD_DURATION),
        _RETURN_DURATION,
    )

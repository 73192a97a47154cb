"""The motions from which the hysteresis of a tube can be read, by name."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable
from dataclasses import dataclass

from endoscope_core.choices import BRIEF, SINUSOID
from endoscope_core.errors import EndoscopeError
from endoscope_core.signals.brief_calibration import BRIEF_RECORD_DURATION, brief_calibration
from endoscope_core.signals.calibration_sinusoid import (
    CALIBRATION_RATE,
    CALIBRATION_RECORD_DURATION,
    calibration_sinusoid,
)
from endoscope_core.signals.signal import Signal


class UnknownCalibrationError(EndoscopeError, ValueError):
    """A calibration motion that there is none of."""


@dataclass(frozen=True)
class CalibrationMotion:
    """What a calibration commands, and how much of it is recorded.

    Parameters
    ----------
    name : str
    signal : Signal
        Of every joint; it ends at rest at zero, after the record.
    samples : int
        Samples of the record at 1 kHz, from the start of the signal.
    """

    name: str
    signal: Signal
    samples: int

    @property
    def settled(self) -> int:
        """First sample of the last whole period, which has forgotten where the motion began."""
        return math.ceil(self.signal.steady[0] * CALIBRATION_RATE)


_MOTIONS: dict[str, tuple[Callable[[], Signal], float]] = {
    SINUSOID: (calibration_sinusoid, CALIBRATION_RECORD_DURATION),
    BRIEF: (brief_calibration, BRIEF_RECORD_DURATION),
}


def calibration_motion(name: str = SINUSOID) -> CalibrationMotion:
    """Calibration motion of a name, one of `CALIBRATION_MOTIONS`.

    Raises
    ------
    UnknownCalibrationError
        If there is none of that name; the message names the nearest.
    """
    if name not in _MOTIONS:
        near = difflib.get_close_matches(name, _MOTIONS, n=1, cutoff=0.0)
        raise UnknownCalibrationError(
            f'unknown calibration motion {name!r}, nearest is {near[0]!r} '
            f'(known: {", ".join(_MOTIONS)})'
        )
    make, duration = _MOTIONS[name]
    return CalibrationMotion(name, make(), round(duration * CALIBRATION_RATE))

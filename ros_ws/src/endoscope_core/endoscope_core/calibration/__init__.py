"""The procedure by which the tube's hysteresis class is found."""

from endoscope_core.calibration.bending_record import BendingRecord
from endoscope_core.calibration.calibration_run import (
    CalibrationCommand,
    CalibrationRun,
    CalibrationStep,
)
from endoscope_core.calibration.tension_record import TensionGapError, TensionRecord
from endoscope_core.calibration.zero_error import words_of, zero_errors

__all__ = [
    'BendingRecord',
    'CalibrationCommand',
    'CalibrationRun',
    'CalibrationStep',
    'TensionGapError',
    'TensionRecord',
    'words_of',
    'zero_errors',
]

"""The procedure by which the tube's hysteresis class is found."""

from endoscope_core.calibration.bending_record import BendingRecord
from endoscope_core.calibration.calibration_run import (
    CalibrationCommand,
    CalibrationRun,
    CalibrationStep,
)
from endoscope_core.calibration.tension_record import TensionGapError, TensionRecord

__all__ = [
    'BendingRecord',
    'CalibrationCommand',
    'CalibrationRun',
    'CalibrationStep',
    'TensionGapError',
    'TensionRecord',
]

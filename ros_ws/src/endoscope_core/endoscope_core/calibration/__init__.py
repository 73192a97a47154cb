"""The procedure by which the tube's hysteresis class is found."""

from endoscope_core.calibration.calibration_run import (
    CalibrationCommand,
    CalibrationRun,
    CalibrationStep,
)
from endoscope_core.calibration.records import (
    BendingRecord,
    TensionGapError,
    TensionRecord,
    words_of,
    zero_errors,
)

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

"""The procedure by which the tube's hysteresis class is found."""

from endoscope_core.calibration.calibration_run import CalibrationRun, CalibrationStep
from endoscope_core.calibration.records import (
    BendingRecord,
    TensionGapError,
    TensionRecord,
    with_zeros,
    words_of,
    zero_errors,
)

__all__ = [
    'BendingRecord',
    'CalibrationRun',
    'CalibrationStep',
    'TensionGapError',
    'TensionRecord',
    'with_zeros',
    'words_of',
    'zero_errors',
]

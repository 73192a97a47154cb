"""The procedure by which the tube's hysteresis class is found."""

from endoscope_core.calibration.calibration_run import (
    CalibrationCommand,
    CalibrationRun,
    CalibrationStep,
)
from endoscope_core.calibration.order_feedback import (
    CALIBRATE,
    HOME,
    OrderCode,
    OrderFeedback,
    OrderState,
)
from endoscope_core.calibration.records import (
    BendingRecord,
    TensionGapError,
    TensionRecord,
    with_zeros,
    words_of,
    zero_errors,
)

__all__ = [
    'CALIBRATE',
    'HOME',
    'BendingRecord',
    'CalibrationCommand',
    'CalibrationRun',
    'CalibrationStep',
    'OrderCode',
    'OrderFeedback',
    'OrderState',
    'TensionGapError',
    'TensionRecord',
    'with_zeros',
    'words_of',
    'zero_errors',
]

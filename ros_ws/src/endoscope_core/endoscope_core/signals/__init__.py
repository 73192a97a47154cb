"""Motions as functions of time: calibration, the papers' signals, commissioning."""

from endoscope_core.choices import BRIEF, CALIBRATION_MOTIONS, SINUSOID
from endoscope_core.signals.brief_calibration import brief_calibration
from endoscope_core.signals.calibration_motion import (
    CalibrationMotion,
    UnknownCalibrationError,
    calibration_motion,
)
from endoscope_core.signals.calibration_sinusoid import (
    CALIBRATION_AMPLITUDE,
    CALIBRATION_RATE,
    CALIBRATION_RECORD_DURATION,
    CALIBRATION_SAMPLES,
    calibration_sinusoid,
)
from endoscope_core.signals.catalogue import MOTIONS, both_joints, motion_by_name
from endoscope_core.signals.commissioning import commissioning_motion
from endoscope_core.signals.signal import Motion, Signal, hold, sequence
from endoscope_core.signals.smooth_ramp import come_to_rest, move
from endoscope_core.signals.tracking_signals import (
    non_periodic_signal,
    periodic_signal,
    sum_of_sines,
)

__all__ = [
    'BRIEF',
    'CALIBRATION_AMPLITUDE',
    'CALIBRATION_MOTIONS',
    'CALIBRATION_RATE',
    'CALIBRATION_RECORD_DURATION',
    'CALIBRATION_SAMPLES',
    'MOTIONS',
    'SINUSOID',
    'CalibrationMotion',
    'Motion',
    'Signal',
    'UnknownCalibrationError',
    'both_joints',
    'brief_calibration',
    'calibration_motion',
    'calibration_sinusoid',
    'come_to_rest',
    'commissioning_motion',
    'hold',
    'motion_by_name',
    'move',
    'non_periodic_signal',
    'periodic_signal',
    'sequence',
    'sum_of_sines',
]

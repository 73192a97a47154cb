"""Motions as functions of time: calibration, the papers' signals, commissioning."""

from endoscope_core.choices import BRIEF, CALIBRATION_MOTIONS, SINUSOID
from endoscope_core.signals.calibration_motion import (
    CALIBRATION_RATE,
    CALIBRATION_RECORD_DURATION,
    CALIBRATION_SAMPLES,
    CalibrationMotion,
    calibration_motion,
    calibration_sinusoid,
)
from endoscope_core.signals.motions import (
    MOTIONS,
    both_joints,
    motion_by_name,
    non_periodic_signal,
    periodic_signal,
    sum_of_sines,
)
from endoscope_core.signals.signal import Motion, Signal, hold, move, sequence

__all__ = [
    'BRIEF',
    'CALIBRATION_MOTIONS',
    'CALIBRATION_RATE',
    'CALIBRATION_RECORD_DURATION',
    'CALIBRATION_SAMPLES',
    'MOTIONS',
    'SINUSOID',
    'CalibrationMotion',
    'Motion',
    'Signal',
    'both_joints',
    'calibration_motion',
    'calibration_sinusoid',
    'hold',
    'motion_by_name',
    'move',
    'non_periodic_signal',
    'periodic_signal',
    'sequence',
    'sum_of_sines',
]

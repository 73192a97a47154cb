"""Motions as functions of time: calibration, the papers' signals, commissioning."""

from endoscope_core.choices import BRIEF, CALIBRATION_MOTIONS, SINUSOID
from endoscope_core.signals.calibration_motion import (
    CALIBRATION_AMPLITUDE,
    CALIBRATION_RATE,
    CALIBRATION_RECORD_DURATION,
    CALIBRATION_SAMPLES,
    CalibrationMotion,
    brief_calibration,
    calibration_motion,
    calibration_sinusoid,
)
from endoscope_core.signals.motions import (
    MOTIONS,
    both_joints,
    commissioning_motion,
    motion_by_name,
    non_periodic_signal,
    periodic_signal,
    sum_of_sines,
)
from endoscope_core.signals.signal import Motion, Signal, come_to_rest, hold, move, sequence

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

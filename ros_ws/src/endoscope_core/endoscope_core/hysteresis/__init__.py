"""Hysteresis models as pure steps of state over input."""

from endoscope_core.hysteresis.bouc_wen import (
    BoucWenParameters,
    bouc_wen_forward,
    bouc_wen_inverse,
    bouc_wen_step,
)

__all__ = ['BoucWenParameters', 'bouc_wen_forward', 'bouc_wen_inverse', 'bouc_wen_step']

"""Hysteresis models as pure steps of state over input, and their inverses."""

from endoscope_core.hysteresis.bouc_wen import BoucWenParameters
from endoscope_core.hysteresis.dahl import DahlParameters
from endoscope_core.hysteresis.memory_model import direct_inverse, forward

__all__ = ['BoucWenParameters', 'DahlParameters', 'direct_inverse', 'forward']

HysteresisParameters = BoucWenParameters | DahlParameters

MODELS: dict[str, type[HysteresisParameters]] = {
    'bouc_wen': BoucWenParameters,
    'dahl': DahlParameters,
}
"""Every model by the name that commands and node parameters use."""

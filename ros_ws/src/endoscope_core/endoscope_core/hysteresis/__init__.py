"""Hysteresis models as pure steps of state over input, and their inverses."""

from endoscope_core.hysteresis.bouc_wen import AsymmetricBoucWenParameters, BoucWenParameters
from endoscope_core.hysteresis.dahl import DahlParameters, PlayParameters
from endoscope_core.hysteresis.memory_model import MemoryModel, direct_inverse, forward
from endoscope_core.hysteresis.prandtl_ishlinskii import (
    PrandtlIshlinskiiParameters,
    prandtl_ishlinskii_forward,
    prandtl_ishlinskii_inverse,
)

__all__ = [
    'AsymmetricBoucWenParameters',
    'BoucWenParameters',
    'DahlParameters',
    'MemoryModel',
    'PlayParameters',
    'PrandtlIshlinskiiParameters',
    'direct_inverse',
    'forward',
    'prandtl_ishlinskii_forward',
    'prandtl_ishlinskii_inverse',
]

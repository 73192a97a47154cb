"""Catalogue of physics that can be added to the nominal plant, one file an effect."""

from endoscope_core.effects import joint_stop, stribeck_friction, transport_delay
from endoscope_core.effects.definition import (
    CATALOGUE,
    EffectDefinition,
    EffectParameter,
    Stage,
)

__all__ = [
    'CATALOGUE',
    'EffectDefinition',
    'EffectParameter',
    'Stage',
    'joint_stop',
    'stribeck_friction',
    'transport_delay',
]

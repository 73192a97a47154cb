"""`stribeck_friction`: sheath friction is higher at low sliding speed."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'stribeck_friction',
    Stage.TRANSMISSION,
    physics='Sheath friction is higher at low sliding speed.',
    equation='phi(v) = phi (1 + rise exp(-(|v| / stribeck_speed)^exponent))',
    source='Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994, eq. 6',
    parameters=(
        EffectParameter('rise', '-', 0.0, 3.0, 0.5, off=0.0, starts=(0.4,)),
        EffectParameter('stribeck_speed', 'm/s', 1e-5, 2e-2, 1e-3, starts=(3e-4, 2e-3)),
        EffectParameter('exponent', '-', 0.5, 2.0, 1.0),
    ),
)
ON = DEFINITION.flag
RISE = DEFINITION.first_parameter
SPEED = RISE + 1
EXPONENT = RISE + 2


@compiled
def friction_factor(parameters: Array, sliding_speed: float) -> float:
    """Factor on the capstan exponent at a sliding speed in m/s."""
    ratio = abs(sliding_speed) / parameters[SPEED]
    if parameters[EXPONENT] != 1.0:
        ratio = ratio ** parameters[EXPONENT]
    return 1.0 + parameters[RISE] * math.exp(-ratio)

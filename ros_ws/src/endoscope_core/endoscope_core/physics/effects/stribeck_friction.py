"""`stribeck_friction`: sheath friction is higher at low sliding speed."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import EXPONENT, hook

EFFECT = Effect(
    'stribeck_friction',
    Stage.TRANSMISSION,
    30,
    physics='Sheath friction is higher at low sliding speed.',
    equation='phi(s) = phi (1 + rise ((1 - tail) exp(-s / stribeck_speed) + tail / (1 + (s / '
    'stribeck_speed)^2))), s = |v|',
    source='Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994, eq. 6',
    parameters=(
        Parameter('rise', '-', 0.0, 3.0, 0.5, off=0.0, starts=(0.4,)),
        Parameter('stribeck_speed', 'm/s', 1e-5, 2e-2, 1e-3, starts=(3e-4, 1e-3, 3e-3)),
        Parameter(
            'tail',
            '-',
            0.0,
            1.0,
            0.0,
            choices=(0.0, 1.0),
            words=('falls exponentially with the speed', 'falls with a long tail'),
        ),
    ),
    traits=Traits(rugged=True, families=('exponent_of_speed',)),
)
RISE, SPEED, TAIL = EFFECT.places


@hook(EFFECT, EXPONENT)
@compiled
def factor(p: Array, x: Array, speed: float, time: float, tick: float) -> float:
    """Factor on the capstan exponent at a sliding speed in m/s."""
    ratio = speed / p[SPEED]
    fall = (1.0 - p[TAIL]) * math.exp(-ratio) + p[TAIL] / (1.0 + ratio * ratio)
    return 1.0 + p[RISE] * fall

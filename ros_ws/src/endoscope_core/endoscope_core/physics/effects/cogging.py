"""`cogging`: ripple between encoder and pulley, periodic in the shaft angle."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import PULLEY_ANGLE, hook

EFFECT = Effect(
    'cogging',
    Stage.ACTUATOR,
    60,
    physics='Ripple between encoder and pulley that repeats with the shaft angle.',
    equation='pulley = shaft + amplitude_rad (f(a) - f(phase_rad)), a = cycles_per_turn shaft + '
    'phase_rad, f(a) = sin a + second_sine sin 2 a + second_cosine cos 2 a',
    source='Transmission error of gears: Munro, Proc. IMechE C 203, 1989; cogging: Proca et al., '
    'IEEE Trans. Magn. 39(3), 2003',
    parameters=(
        Parameter('amplitude_rad', 'rad', 0.0, 0.3, 0.03, off=0.0, starts=(0.02,)),
        Parameter(
            'cycles_per_turn',
            '-',
            1.0,
            64.0,
            12.0,
            starts=(4.0, 7.0, 10.0, 13.0, 16.0, 20.0, 24.0, 30.0),
        ),
        Parameter('phase_rad', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6), phase=True),
        Parameter('second_sine', '-', -1.0, 1.0, 0.0),
        Parameter('second_cosine', '-', -1.0, 1.0, 0.0),
    ),
    traits=Traits(families=('pulley_periodic', 'pulley_of_shaft')),
)
AMPLITUDE, CYCLES, PHASE, SECOND_SINE, SECOND_COSINE = EFFECT.places


@hook(EFFECT, PULLEY_ANGLE)
@compiled
def rippled(p: Array, x: Array, shaft: float) -> float:
    """Pulley's angle in rad; zero at the angle zero."""
    angle = p[CYCLES] * shaft + p[PHASE]
    return shaft + p[AMPLITUDE] * (_wave(p, angle) - _wave(p, p[PHASE]))


@compiled
def _wave(p: Array, angle: float) -> float:
    second = p[SECOND_SINE] * math.sin(2.0 * angle)
    return math.sin(angle) + second + p[SECOND_COSINE] * math.cos(2.0 * angle)

"""`cogging`: ripple between encoder and pulley, periodic in the shaft angle."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import JOINT_RADIUS, PULLEY_RADIUS

DEFINITION = define(
    'cogging',
    Stage.ACTUATOR,
    physics='Ripple between encoder and pulley that repeats with the shaft angle.',
    equation='pulley = shaft + amplitude_rad (f(a) - f(phase_rad)), a = cycles_per_turn shaft + '
    'phase_rad, f(a) = sin a + second_sine sin 2 a + second_cosine cos 2 a',
    source='Transmission error of gears: Munro, Proc. IMechE C 203, 1989; cogging: Proca et al., '
    'IEEE Trans. Magn. 39(3), 2003',
    parameters=(
        EffectParameter('amplitude_rad', 'rad', 0.0, 0.3, 0.03, off=0.0, starts=(0.02,)),
        EffectParameter(
            'cycles_per_turn',
            '-',
            1.0,
            64.0,
            12.0,
            starts=(4.0, 7.0, 10.0, 13.0, 16.0, 20.0, 24.0, 30.0),
        ),
        EffectParameter('phase_rad', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6), phase=True),
        EffectParameter('second_sine', '-', -1.0, 1.0, 0.0),
        EffectParameter('second_cosine', '-', -1.0, 1.0, 0.0),
    ),
)
ON = DEFINITION.flag
AMPLITUDE = DEFINITION.first_parameter
CYCLES = AMPLITUDE + 1
PHASE = AMPLITUDE + 2
SECOND_SINE = AMPLITUDE + 3
SECOND_COSINE = AMPLITUDE + 4


@compiled
def ripple(parameters: Array, motor: float) -> float:
    """Pulley's deviation from a motor angle, both joint-equivalent; zero at the angle zero."""
    gear = parameters[JOINT_RADIUS] / parameters[PULLEY_RADIUS]
    phase = parameters[PHASE]
    angle = parameters[CYCLES] * gear * motor + phase
    deviation = _wave(parameters, angle) - _wave(parameters, phase)
    return parameters[AMPLITUDE] / gear * deviation


@compiled
def _wave(parameters: Array, angle: float) -> float:
    second = parameters[SECOND_SINE] * math.sin(2.0 * angle)
    return math.sin(angle) + second + parameters[SECOND_COSINE] * math.cos(2.0 * angle)

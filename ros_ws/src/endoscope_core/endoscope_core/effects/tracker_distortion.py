"""`tracker_distortion`: metal nearby bends the tracker's angle."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'tracker_distortion',
    Stage.SENSING,
    physics="Metal nearby distorts the field: the tracker's angle is a nonlinear function of the "
    'true one.',
    equation='reading = q + linear q + quadratic q^2 + cubic q^3 + wave_rad (sin(wave_number q + '
    'wave_phase) - sin(wave_phase))',
    source='Kindratenko, Virtual Reality 5, 2000 (polynomials, and harmonics of the field map)',
    parameters=(
        EffectParameter('linear', '-', -0.5, 0.5, 0.0, off=0.0),
        EffectParameter('quadratic', '1/rad', -0.5, 0.5, 0.03, off=0.0, starts=(0.03,)),
        EffectParameter('cubic', '1/rad^2', -0.5, 0.5, -0.03, off=0.0, starts=(-0.02,)),
        EffectParameter('wave_rad', 'rad', -0.3, 0.3, 0.0, off=0.0, starts=(0.02,)),
        EffectParameter('wave_number', '1/rad', 2.0, 8.0, 4.0, starts=(2.8, 4.5)),
        EffectParameter('wave_phase', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6)),
    ),
)
ON = DEFINITION.flag
LINEAR = DEFINITION.first_parameter
QUADRATIC = LINEAR + 1
CUBIC = LINEAR + 2
WAVE = LINEAR + 3
WAVE_NUMBER = LINEAR + 4
WAVE_PHASE = LINEAR + 5


@compiled
def reading(parameters: Array, angle: float) -> float:
    """Angle in rad as the tracker reads it."""
    factor = parameters[QUADRATIC] + angle * parameters[CUBIC]
    phase = parameters[WAVE_PHASE]
    wave = math.sin(parameters[WAVE_NUMBER] * angle + phase) - math.sin(phase)
    bent = angle * (parameters[LINEAR] + angle * factor)
    return angle + bent + parameters[WAVE] * wave

"""`tracker_distortion`: metal nearby bends the tracker's angle."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import TRACKER, hook

EFFECT = Effect(
    'tracker_distortion',
    Stage.SENSING,
    20,
    physics="Metal nearby distorts the field: the tracker's angle is a nonlinear function of the "
    'true one.',
    equation='reading = q + linear q + quadratic q^2 + cubic q^3 + wave_rad (sin(wave_number q + '
    'wave_phase) - sin(wave_phase))',
    source='Kindratenko, Virtual Reality 5, 2000 (polynomials, and harmonics of the field map)',
    parameters=(
        Parameter('linear', '-', -0.5, 0.5, 0.0, off=0.0),
        Parameter('quadratic', '1/rad', -0.5, 0.5, 0.1, off=0.0, starts=(0.1,)),
        Parameter('cubic', '1/rad^2', -1.0, 1.0, -0.2, off=0.0, starts=(-0.1,)),
        Parameter('wave_rad', 'rad', -0.3, 0.3, 0.0, off=0.0, starts=(0.02,)),
        Parameter('wave_number', '1/rad', 2.0, 16.0, 8.0, starts=(5.0, 9.0)),
        Parameter('wave_phase', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6)),
    ),
    traits=Traits(families=('tracker_of_angle',)),
)
LINEAR, QUADRATIC, CUBIC, WAVE, WAVE_NUMBER, WAVE_PHASE = EFFECT.places


@hook(EFFECT, TRACKER)
@compiled
def distorted(p: Array, x: Array, angle: float, history: Array, time: float, tick: float) -> float:
    """Angle in rad as the tracker reads it."""
    bent = angle * (p[LINEAR] + angle * (p[QUADRATIC] + angle * p[CUBIC]))
    wave = math.sin(p[WAVE_NUMBER] * angle + p[WAVE_PHASE]) - math.sin(p[WAVE_PHASE])
    return angle + bent + p[WAVE] * wave

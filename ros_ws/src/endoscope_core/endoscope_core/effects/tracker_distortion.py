"""`tracker_distortion`: metal nearby bends the tracker's angle."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'tracker_distortion',
    Stage.SENSING,
    physics="Metal nearby distorts the field: the tracker's angle is a nonlinear function of the "
    'true one.',
    equation='reading = q + linear q + quadratic q^2 + cubic q^3',
    source='Kindratenko, Virtual Reality 5, 2000 (polynomial distortion models)',
    parameters=(
        EffectParameter('linear', '-', -0.5, 0.5, 0.0, off=0.0),
        EffectParameter('quadratic', '1/rad', -0.5, 0.5, 0.03, off=0.0, starts=(0.03,)),
        EffectParameter('cubic', '1/rad^2', -0.5, 0.5, -0.03, off=0.0, starts=(-0.02,)),
    ),
)
ON = DEFINITION.flag
LINEAR = DEFINITION.first_parameter
QUADRATIC = LINEAR + 1
CUBIC = LINEAR + 2


@compiled
def reading(parameters: Array, angle: float) -> float:
    """Angle in rad as the tracker reads it."""
    factor = parameters[QUADRATIC] + angle * parameters[CUBIC]
    return angle + angle * (parameters[LINEAR] + angle * factor)

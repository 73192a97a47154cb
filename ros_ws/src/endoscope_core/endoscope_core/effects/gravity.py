"""`gravity`: a moment that depends on the sine of the bending angle."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'gravity',
    Stage.JOINT,
    physics='The weight of the bending section, a moment with the sine of the bending angle.',
    equation='tau = -moment_nm sin(q + phase_rad)',
    source='Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, sec. 7.3',
    parameters=(
        EffectParameter('moment_nm', 'N m', 0.0, 0.1, 0.005, off=0.0, starts=(0.003,)),
        EffectParameter('phase_rad', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6, 3.1, -1.6)),
    ),
)
ON = DEFINITION.flag
MOMENT = DEFINITION.first_parameter
PHASE = MOMENT + 1


@compiled
def moment_and_slope(parameters: Array, angle: float) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the angle in N m/rad."""
    along = angle + parameters[PHASE]
    return -parameters[MOMENT] * math.sin(along), parameters[MOMENT] * math.cos(along)

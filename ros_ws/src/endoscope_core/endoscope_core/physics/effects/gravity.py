"""`gravity`: a moment that depends on the sine of the bending angle."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import LOAD, hook

EFFECT = Effect(
    'gravity',
    Stage.JOINT,
    30,
    physics='The weight of the bending section, a moment with the sine of the bending angle.',
    equation='tau = -moment_nm sin(q + phase_rad)',
    source='Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, 2006, sec. 7.3',
    parameters=(
        Parameter('moment_nm', 'N m', 0.0, 0.1, 0.001, off=0.0, starts=(0.0006,)),
        Parameter('phase_rad', 'rad', -7.0, 7.0, 0.0, starts=(0.0, 1.6, 3.1, -1.6)),
    ),
    traits=Traits(families=('load_of_angle',)),
)
MOMENT, PHASE = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the angle in N m/rad."""
    along = angle + p[PHASE]
    return -p[MOMENT] * math.sin(along), p[MOMENT] * math.cos(along)

"""`contact`: compliant, one-sided contact with tissue beyond an angle."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import push_back
from endoscope_core.physics.hooks import LOAD, hook

EFFECT = Effect(
    'contact',
    Stage.JOINT,
    25,
    physics='Compliant, one-sided contact (tissue) beyond an angle.',
    equation="tau = -s stiffness d (d / 0.2 rad)^(exponent - 1) max(0, 1 + loss_s d'), "
    'd = s (q - angle_rad) > 0, s = sgn(angle_rad)',
    source='Hunt, Crossley, J. Appl. Mech. 42, 1975',
    parameters=(
        Parameter(
            'angle_rad',
            'rad',
            -2.5,
            2.5,
            0.2,
            off=2.5,
            starts=(0.1, 0.18, 0.26, 0.36, 0.5, 0.7, -0.1, -0.18, -0.26, -0.36, -0.5, -0.7),
            comparable=True,
        ),
        Parameter('stiffness', 'N m/rad', 0.0, 1.0, 0.01, off=0.0, starts=(0.006,)),
        Parameter('exponent', '-', 1.0, 2.5, 1.0),
        Parameter('loss_s', 's', 0.0, 0.5, 0.0),
    ),
    traits=Traits(families=('load_of_angle',)),
)
ANGLE, STIFFNESS, EXPONENT, LOSS = EFFECT.places
DEPTH = 0.2


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the step in N m/rad."""
    side = 1.0 if p[ANGLE] > 0.0 else -1.0
    deep = side * (angle - p[ANGLE])
    if deep <= 0.0:
        return 0.0, 0.0
    stiffness = p[STIFFNESS] * DEPTH ** (1.0 - p[EXPONENT])
    push, by_depth, by_speed = push_back(deep, side * step / tick, stiffness, p[EXPONENT], p[LOSS])
    return -side * push, by_depth + by_speed / tick

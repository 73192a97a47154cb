"""`joint_stop`: a stiff, two-sided end stop of the bending section."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import push_back
from endoscope_core.physics.hooks import LOAD, hook

EFFECT = Effect(
    'joint_stop',
    Stage.JOINT,
    20,
    physics='A stiff, two-sided end stop limits the bending angle.',
    equation="tau = -sgn(q) stiffness d max(0, 1 + loss_s d'), d = |q| - angle_rad > 0",
    source='Unilateral constraint with damping that grows with depth: Gilardi, Sharf, Mech. Mach. '
    'Theory 37, 2002',
    parameters=(
        Parameter(
            'angle_rad',
            'rad',
            0.05,
            2.5,
            0.25,
            off=2.5,
            starts=tuple(0.1 * 1.07**k for k in range(32)),
            comparable=True,
            scale=0.05,
        ),
        Parameter('stiffness', 'N m/rad', 0.001, 2.0, 0.1, starts=(0.05,)),
        Parameter('loss_s', 's', 0.0, 0.5, 0.0),
    ),
    traits=Traits(families=('load_of_angle',)),
)
ANGLE, STIFFNESS, LOSS = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the step in N m/rad."""
    beyond = abs(angle) - p[ANGLE]
    if beyond <= 0.0:
        return 0.0, 0.0
    side = 1.0 if angle > 0.0 else -1.0
    push, by_depth, by_speed = push_back(beyond, side * step / tick, p[STIFFNESS], 1.0, p[LOSS])
    return -side * push, by_depth + by_speed / tick

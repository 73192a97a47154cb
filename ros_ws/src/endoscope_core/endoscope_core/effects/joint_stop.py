"""`joint_stop`: a stiff, two-sided end stop of the bending section."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'joint_stop',
    Stage.JOINT,
    physics='A stiff, two-sided end stop limits the bending angle.',
    equation="tau = -stiffness d (sgn q + loss_s q'), d = |q| - angle_rad > 0",
    source='Unilateral constraint with damping that grows with depth: Gilardi, Sharf, Mech. Mach. '
    'Theory 37, 2002',
    parameters=(
        EffectParameter(
            'angle_rad',
            'rad',
            0.05,
            2.5,
            0.6,
            off=2.5,
            starts=tuple(0.25 * 1.06**k for k in range(32)),
            comparable=True,
            scale=0.05,
        ),
        EffectParameter('stiffness', 'N m/rad', 0.005, 2.0, 0.2, starts=(0.1,)),
        EffectParameter('loss_s', 's', 0.0, 0.5, 0.0),
    ),
)
ON = DEFINITION.flag
ANGLE = DEFINITION.first_parameter
STIFFNESS = ANGLE + 1
LOSS = ANGLE + 2


@compiled
def moment_and_slope(parameters: Array, angle: float) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the angle in N m/rad."""
    beyond = abs(angle) - parameters[ANGLE]
    if beyond <= 0.0:
        return 0.0, 0.0
    moment = parameters[STIFFNESS] * beyond
    return (-moment if angle > 0.0 else moment), parameters[STIFFNESS]

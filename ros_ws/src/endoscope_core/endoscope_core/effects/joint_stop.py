"""`joint_stop`: a stiff, two-sided end stop of the bending section."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'joint_stop',
    Stage.JOINT,
    physics='A stiff, two-sided end stop limits the bending angle.',
    equation='tau = -stiffness (|q| - angle_rad) sgn q where |q| > angle_rad',
    source='Kelvin-Voigt unilateral constraint: Gilardi, Sharf, Mech. Mach. Theory 37, 2002',
    parameters=(
        EffectParameter(
            'angle_rad', 'rad', 0.05, 2.5, 0.6, off=2.5, starts=(0.4, 0.6, 0.8), comparable=True
        ),
        EffectParameter('stiffness', 'N m/rad', 0.005, 2.0, 0.2, starts=(0.1,)),
    ),
)
ON = DEFINITION.flag
ANGLE = DEFINITION.first_parameter
STIFFNESS = ANGLE + 1


@compiled
def moment_and_slope(parameters: Array, angle: float) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the angle in N m/rad."""
    beyond = abs(angle) - parameters[ANGLE]
    if beyond <= 0.0:
        return 0.0, 0.0
    moment = parameters[STIFFNESS] * beyond
    return (-moment if angle > 0.0 else moment), parameters[STIFFNESS]

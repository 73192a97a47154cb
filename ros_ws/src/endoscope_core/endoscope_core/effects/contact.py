"""`contact`: compliant, one-sided contact with tissue beyond an angle."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'contact',
    Stage.JOINT,
    physics='Compliant, one-sided contact (tissue) beyond an angle.',
    equation="tau = -stiffness d (d / 0.2 rad)^(exponent - 1) (s + loss_s q'), "
    'd = s (q - angle_rad) > 0, s = sgn(angle_rad)',
    source='Hunt, Crossley, J. Appl. Mech. 42, 1975',
    parameters=(
        EffectParameter(
            'angle_rad',
            'rad',
            -2.5,
            2.5,
            0.5,
            off=2.5,
            starts=(0.2, 0.35, 0.5, 0.65, 0.8, 1.0, -0.2, -0.35, -0.5, -0.65, -0.8, -1.0),
            comparable=True,
        ),
        EffectParameter('stiffness', 'N m/rad', 0.0, 1.0, 0.02, off=0.0, starts=(0.015,)),
        EffectParameter('exponent', '-', 1.0, 2.5, 1.0),
        EffectParameter('loss_s', 's', 0.0, 0.5, 0.0),
    ),
)
ON = DEFINITION.flag
ANGLE = DEFINITION.first_parameter
STIFFNESS = ANGLE + 1
EXPONENT = ANGLE + 2
LOSS = ANGLE + 3
DEPTH = 0.2


@compiled
def moment_and_slope(parameters: Array, angle: float) -> tuple[float, float]:
    """Moment in N m on the joint, and minus its derivative by the angle in N m/rad."""
    side = 1.0 if parameters[ANGLE] > 0.0 else -1.0
    deep = side * (angle - parameters[ANGLE])
    if deep <= 0.0:
        return 0.0, 0.0
    stiffness = parameters[STIFFNESS]
    exponent = parameters[EXPONENT]
    if exponent != 1.0:
        stiffness *= (deep / DEPTH) ** (exponent - 1.0)
    return -side * stiffness * deep, stiffness * exponent

"""`rate_limit`: the servo's speed saturates."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import JOINT_RADIUS, PULLEY_RADIUS

DEFINITION = define(
    'rate_limit',
    Stage.ACTUATOR,
    physics="The servo's speed saturates.",
    equation="m'' = 2 zeta wm (sat(wm (u - m) / (2 zeta), limit / gear) - m')",
    source='Position loop around a saturated speed loop: Ellis, Control System Design Guide, '
    '4th ed. 2012, ch. 17',
    parameters=(
        EffectParameter(
            'limit_rad_per_s',
            'rad/s',
            0.02,
            200.0,
            0.6,
            off=200.0,
            starts=(0.3, 0.7, 1.5),
            comparable=True,
        ),
    ),
)
ON = DEFINITION.flag
LIMIT = DEFINITION.first_parameter


@compiled
def limited_error(
    parameters: Array,
    error: float,
    speed_from_error: float,
    speed_kept: float,
) -> float:
    """Servo's error in rad, joint-equivalent, cut where its speed would settle above the limit.

    Over one step the servo's speed becomes ``speed_from_error * error + speed_kept * speed``.
    """
    limit = parameters[LIMIT] * parameters[PULLEY_RADIUS] / parameters[JOINT_RADIUS]
    largest = limit * (1.0 - speed_kept) / max(-speed_from_error, 1e-12)
    return min(largest, max(-largest, error))

"""`rate_limit`: the servo's speed, or that of its command, saturates."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import COMMAND, SERVO_ERROR, hook
from endoscope_core.physics.layout import SLOTS

EFFECT = Effect(
    'rate_limit',
    Stage.ACTUATOR,
    30,
    physics="The servo's speed saturates, or (of_command) its command is slewed.",
    equation="m'' = 2 zeta wm (sat(wm (u - m) / (2 zeta), limit) - m'), or |u'| <= limit",
    source='Position loop around a saturated speed loop: Ellis, Control System Design Guide, '
    '4th ed. 2012, ch. 17; slewed command: Rundqwist, Stahl-Gunnarsson, Phase '
    'compensation of rate limiters in unstable aircraft, IEEE CCA 1996',
    parameters=(
        Parameter(
            'limit_rad_per_s',
            'rad/s',
            0.02,
            200.0,
            0.4,
            off=200.0,
            starts=(0.2, 0.4, 0.7, 1.5),
            comparable=True,
        ),
        Parameter(
            'of_command',
            '-',
            0.0,
            1.0,
            0.0,
            choices=(0.0, 1.0),
            words=('the servo saturates', 'the command is slewed'),
        ),
    ),
    traits=Traits(families=('servo_error_of_error',)),
)
LIMIT, OF_COMMAND = EFFECT.places
SLEWED = SLOTS.shaft_angle()


@hook(EFFECT, SERVO_ERROR)
@compiled
def limited(p: Array, x: Array, error: float, from_error: float, kept: float) -> float:
    """Servo's error in rad, cut where its speed would settle above the limit."""
    if p[OF_COMMAND] > 0.5:
        return error
    largest = p[LIMIT] * (1.0 - kept) / max(-from_error, 1e-12)
    return min(largest, max(-largest, error))


@hook(EFFECT, COMMAND)
@compiled
def slewed(p: Array, x: Array, command: float, history: Array, tick: float) -> float:
    """Mean of the slewed command over a tick with `command` held; advances the slew."""
    if p[OF_COMMAND] <= 0.5:
        return command
    missing = command - x[SLEWED]
    most = p[LIMIT] * tick
    if abs(missing) > most:
        x[SLEWED] += math.copysign(most, missing)
        return x[SLEWED] - math.copysign(0.5 * most, missing)
    x[SLEWED] = command
    # Slewing for a share of the tick, arrived for the rest.
    return command - 0.5 * missing * abs(missing) / most

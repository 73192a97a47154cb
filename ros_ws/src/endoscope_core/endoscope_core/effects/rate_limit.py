"""`rate_limit`: the servo's speed, or that of its command, saturates."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import JOINT_RADIUS, PULLEY_RADIUS, SLOTS

DEFINITION = define(
    'rate_limit',
    Stage.ACTUATOR,
    physics="The servo's speed saturates, or (of_command) its command is slewed.",
    equation="m'' = 2 zeta wm (sat(wm (u - m) / (2 zeta), limit / gear) - m'), or |u'| <= limit / "
    'gear',
    source='Position loop around a saturated speed loop: Ellis, Control System Design Guide, '
    '4th ed. 2012, ch. 17; slewed command: Rundqwist, Stahl-Gunnarsson, Phase '
    'compensation of rate limiters in unstable aircraft, IEEE CCA 1996',
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
        EffectParameter('of_command', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
LIMIT = DEFINITION.first_parameter
OF_COMMAND = LIMIT + 1
COMMAND = SLOTS.angle_state()


@compiled
def largest_speed(parameters: Array) -> float:
    """Limit in rad/s, joint-equivalent."""
    return parameters[LIMIT] * parameters[PULLEY_RADIUS] / parameters[JOINT_RADIUS]


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
    largest = largest_speed(parameters) * (1.0 - speed_kept) / max(-speed_from_error, 1e-12)
    return min(largest, max(-largest, error))


@compiled
def slewed_command(state: Array, parameters: Array, command: float, duration: float) -> float:
    """Mean of the slewed command over a step with `command` held; advances the slew."""
    way = command - state[COMMAND]
    most = largest_speed(parameters) * duration
    if abs(way) > most:
        state[COMMAND] += math.copysign(most, way)
        return state[COMMAND] - math.copysign(0.5 * most, way)
    state[COMMAND] = command
    # On the way for a share of the step, there for the rest.
    return command - 0.5 * way * abs(way) / most

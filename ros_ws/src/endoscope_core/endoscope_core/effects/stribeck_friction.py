"""`stribeck_friction`: sheath friction is higher at low sliding speed."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects import dahl
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import CAPSTAN_EXPONENT, JOINT_DAMPING, JOINT_RADIUS, SLOTS

DEFINITION = define(
    'stribeck_friction',
    Stage.TRANSMISSION,
    physics='Sheath friction is higher at low sliding speed; where it falls so steeply that the '
    'wire cannot slide smoothly, the wire shudders.',
    equation="z' = (v - s z / g) / xs, g = 1 + rise exp(-s_g / stribeck_speed); s, s_g: mean "
    'speeds of a wire that shudders at the speed of neutral stability, else |v|',
    source='LuGre: Canudas de Wit et al., IEEE Trans. Autom. Control 40(3), 1995; averaged over '
    'fast shudder as in Iannelli et al., Automatica 42(4), 2006',
    parameters=(
        EffectParameter('rise', '-', 0.0, 3.0, 0.5, off=0.0, starts=(0.4,)),
        EffectParameter('stribeck_speed', 'm/s', 1e-5, 2e-2, 1e-3, starts=(3e-4, 2e-3)),
        EffectParameter('shudder', '-', 0.0, 3.0, 1.0, starts=(0.1, 1.0)),
    ),
)
ON = DEFINITION.flag
RISE = DEFINITION.first_parameter
SPEED = RISE + 1
SHUDDER = RISE + 2
BRAKING = SLOTS.state_block()
"""By how much the wires' friction would brake the joint per unit of exponent and radius, N."""

FRICTION_SHARE = 0.5
"""Share of the shudder's speed at which the mean friction of a shuddering wire is found; from
iterating ``v -> pull(v) / damping`` to its invariant distribution."""


@compiled
def ceiling_and_shudder(state: Array, parameters: Array, speed: float) -> tuple[float, float]:
    """Value that the pre-sliding states approach at a steady speed, and the wire's shudder.

    Both speeds in m/s. The friction follows the speed over the pre-sliding distance. A capstan
    exponent that followed at once would leave the massless joint's speed ambiguous below the speed
    where the friction's fall outweighs the joint's damping. There a wire jumps to and fro between
    fast and slow sliding; what remains on average is shaken friction.
    """
    stribeck_speed = parameters[SPEED]
    lever = 0.5 * parameters[JOINT_RADIUS]
    steepest = parameters[RISE] / stribeck_speed * lever * lever * state[BRAKING]
    instability = steepest * parameters[CAPSTAN_EXPONENT] / parameters[JOINT_DAMPING]
    # A smooth max(0, log(instability)): the fall is exponential in the speed.
    neutral = stribeck_speed * 0.5 * math.log1p(instability * instability)
    shudder = parameters[SHUDDER] * neutral
    friction_speed = dahl.path_length(speed, FRICTION_SHARE * shudder)
    return 1.0 + parameters[RISE] * math.exp(-friction_speed / stribeck_speed), shudder

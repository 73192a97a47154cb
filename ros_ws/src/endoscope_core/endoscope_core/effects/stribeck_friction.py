"""`stribeck_friction`: sheath friction is higher at low sliding speed."""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import dahl
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import CAPSTAN_EXPONENT, JOINT_DAMPING, JOINT_RADIUS, SLOTS

DEFINITION = define(
    'stribeck_friction',
    Stage.TRANSMISSION,
    physics='Sheath friction is higher at low sliding speed. Where it follows the speed at once '
    'and falls so steeply that the wire cannot slide smoothly, wire and joint shudder and shake '
    'friction off; where it lags behind the speed, they stick and slip.',
    equation='phi(s) = phi (1 + rise ((1 - tail) exp(-s / stribeck_speed) + tail / (1 + (s / '
    "stribeck_speed)^2))), z' = (v - s z) / xs; mean speed s of the path: |v| and, below the speed "
    "of neutral stability, shudder times that; if lagging, memory_s s' = |v| - s and z' = (v - "
    '|v| z) / xs',
    source='Armstrong-Helouvry, Dupont, Canudas de Wit, Automatica 30(7), 1994, eq. 6, with '
    'frictional memory; averaged over fast shudder as in Iannelli et al., '
    'Automatica 42(4), 2006',
    parameters=(
        EffectParameter('rise', '-', 0.0, 3.0, 0.5, off=0.0, starts=(0.4,)),
        EffectParameter('stribeck_speed', 'm/s', 1e-5, 2e-2, 1e-3, starts=(1e-3, 3e-3)),
        EffectParameter('shudder', '-', 0.8, 5.0, 1.0),
        EffectParameter('tail', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
        EffectParameter('lagging', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
        EffectParameter('memory_s', 's', 5e-5, 5e-2, 3e-3, starts=(5e-4, 3e-3)),
    ),
)
ON = DEFINITION.flag
RISE = DEFINITION.first_parameter
SPEED = RISE + 1
SHUDDER = RISE + 2
TAIL = RISE + 3
LAGGING = RISE + 4
MEMORY = RISE + 5
REMEMBERED_SPEED = SLOTS.state_block()
"""Sliding speed in m/s that lagging friction acts on."""
BRAKING = SLOTS.state_block()
"""By how much the wires' friction would brake the joint per unit of exponent and radius, N."""

LEAST_RESISTANCE = 0.1
"""Share of the joint's damping that remains however steeply friction falls within a step."""
FRICTION_SHARE = 0.9
"""Share of the shudder's speed at which a shuddering wire's mean friction is found."""


@compiled
def is_lagging(parameters: Array, on: Flags) -> bool:
    """Whether the friction lags behind the speed, so that wires stick and slip."""
    return on[ON] and parameters[LAGGING] > 0.0


@compiled
def factor_and_shudder(
    state: Array, parameters: Array, speed: float, ahead: float
) -> tuple[float, float]:
    """Factor on the capstan exponent at a mean sliding speed, and the wire's shudder.

    Both speeds in m/s; lagging friction is that of `ahead` s later. Where friction's fall with
    speed outweighs the joint's damping, the massless joint's speed is ambiguous, and it jumps to
    and fro between fast and slow sliding many times a millisecond. The averages of that motion
    vary smoothly with every parameter; the motion itself is chaotic and cannot be fitted.
    """
    stribeck_speed = parameters[SPEED]
    if parameters[LAGGING] > 0.0:
        later, _ = _remembered(state, parameters, speed, ahead)
        return _factor(parameters, later), 0.0
    lever = 0.5 * parameters[JOINT_RADIUS]
    steepest = parameters[RISE] / stribeck_speed * lever * lever * state[BRAKING]
    instability = steepest * parameters[CAPSTAN_EXPONENT] / parameters[JOINT_DAMPING]
    shudder = parameters[SHUDDER] * stribeck_speed * _shudder_of(instability)
    mean_speed = dahl.path_length(speed, FRICTION_SHARE * shudder)
    return _factor(parameters, mean_speed), shudder


@compiled
def steepness(state: Array, parameters: Array, speed: float, ahead: float) -> float:
    """Relative slope of lagging friction `ahead` s later by the sliding speed until then, s/m."""
    later, share = _remembered(state, parameters, speed, ahead)
    ratio = later / parameters[SPEED]
    tail = parameters[TAIL]
    broad = 1.0 / (1.0 + ratio * ratio)
    slope = (tail - 1.0) * math.exp(-ratio) - 2.0 * tail * ratio * broad * broad
    slope *= share * parameters[RISE] / parameters[SPEED] / _factor(parameters, later)
    return slope if speed > 0.0 else -slope


@compiled
def remember(state: Array, parameters: Array, speed: float, duration: float) -> None:
    """Let the speed that lagging friction acts on follow the sliding speed in m/s."""
    state[REMEMBERED_SPEED], _ = _remembered(state, parameters, speed, duration)


@compiled
def _remembered(
    state: Array, parameters: Array, speed: float, duration: float
) -> tuple[float, float]:
    """Remembered speed after sliding at a speed for a duration, and its slope by that speed."""
    share = -math.expm1(-duration / parameters[MEMORY])
    before = state[REMEMBERED_SPEED]
    return before + share * (abs(speed) - before), share


@compiled
def _factor(parameters: Array, speed: float) -> float:
    ratio = speed / parameters[SPEED]
    tail = parameters[TAIL]
    fall = (1.0 - tail) * math.exp(-ratio) + tail / (1.0 + ratio * ratio)
    return 1.0 + parameters[RISE] * fall


@compiled
def _shudder_of(instability: float) -> float:
    """Mean of |y|, where that of y is zero, over the orbit of ``y = a - instability exp(-|y|)``.

    y is the sliding speed in Stribeck speeds. Fitted to iterates of the map for instabilities from
    3 to 24; zero, smoothly, where the map has one stable point.
    """
    if instability <= 0.0:
        return 0.0
    excess = (1.15 * math.log(instability) - 0.75) / 0.3
    mean = 0.3 * (math.log1p(math.exp(excess)) if excess < 30.0 else excess)
    return mean * min(1.0, (instability / 0.9) ** 4)

"""`actuator_lag`: the servo is slower by an additional first-order lag."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.hooks import COMMAND, hook
from endoscope_core.physics.layout import SLOTS

EFFECT = Effect(
    'actuator_lag',
    Stage.ACTUATOR,
    20,
    physics='The servo is slower: its command passes through an additional first-order lag.',
    equation="u_f' = (u - u_f) / time_constant_s",
    source='Ogata, Modern Control Engineering, 5th ed. 2010, sec. 5-2',
    parameters=(
        Parameter(
            'time_constant_s', 's', 0.0, 1.0, 0.03, off=0.0, starts=(0.01, 0.06), comparable=True
        ),
    ),
)
(TIME_CONSTANT,) = EFFECT.places
LAGGED = SLOTS.shaft_angle()


@hook(EFFECT, COMMAND)
@compiled
def lagged(p: Array, x: Array, command: float, history: Array, tick: float) -> float:
    """Mean of the lagged command over a tick with `command` held; advances the lag."""
    if p[TIME_CONSTANT] <= 0.0:
        x[LAGGED] = command
        return command
    ratio = tick / p[TIME_CONSTANT]
    error = x[LAGGED] - command
    share = -math.expm1(-ratio)
    x[LAGGED] = command + (1.0 - share) * error
    return command + error * share / ratio

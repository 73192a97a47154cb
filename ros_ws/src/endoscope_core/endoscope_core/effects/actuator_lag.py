"""`actuator_lag`: the servo is slower by an additional first-order lag."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS

DEFINITION = define(
    'actuator_lag',
    Stage.ACTUATOR,
    physics='The servo is slower: its command passes through an additional first-order lag.',
    equation="u_f' = (u - u_f) / time_constant_s",
    source='Ogata, Modern Control Engineering, 5th ed. 2010, sec. 5-2',
    parameters=(
        EffectParameter(
            'time_constant_s', 's', 0.0, 1.0, 0.03, off=0.0, starts=(0.01, 0.06), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
TIME_CONSTANT = DEFINITION.first_parameter
COMMAND = SLOTS.angle_state()


@compiled
def lagged_command(state: Array, parameters: Array, command: float, duration: float) -> float:
    """Mean of the lagged command over a step with `command` held; advances the lag."""
    if parameters[TIME_CONSTANT] <= 0.0:
        state[COMMAND] = command
        return command
    ratio = duration / parameters[TIME_CONSTANT]
    error = state[COMMAND] - command
    share = -math.expm1(-ratio)
    state[COMMAND] = command + (1.0 - share) * error
    return command + error * share / ratio

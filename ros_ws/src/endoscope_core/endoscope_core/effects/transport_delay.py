"""`transport_delay`: the command reaches the servo late."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import COMMAND_HISTORY, HISTORY, TICKS

DEFINITION = define(
    'transport_delay',
    Stage.ACTUATOR,
    physics='The command reaches the servo late.',
    equation='u_servo(t) = u(t - delay_s)',
    source='Normey-Rico, Camacho, Control of Dead-time Processes, Springer 2007, ch. 2',
    parameters=(
        EffectParameter(
            'delay_s', 's', 0.0, 0.5, 0.02, off=0.0, starts=(0.005, 0.03), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
DELAY = DEFINITION.first_parameter


@compiled
def delayed_command(
    state: Array,
    parameters: Array,
    history: Array,
    fraction: float,
    width: float,
    tick: float,
) -> float:
    """Mean of the delayed, held command over one substep.

    `fraction` and `width` are the substep's start and length in ticks. The mean, not the value at
    one instant, keeps the plant's answer a continuous function of the delay. Before the first
    command the first one is taken to have been in force.
    """
    start = max(state[TICKS] + fraction - parameters[DELAY] / tick, 0.0)
    index = int(start)
    newer_share = min(1.0, max(0.0, (start + width - (index + 1)) / width))
    older = history[COMMAND_HISTORY, index % HISTORY]
    newer = history[COMMAND_HISTORY, min(index + 1, int(state[TICKS])) % HISTORY]
    return older + newer_share * (newer - older)

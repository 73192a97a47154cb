"""`transport_delay`: the command reaches the servo late."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.effects.laws import value_before
from endoscope_core.physics.hooks import COMMAND, hook
from endoscope_core.physics.layout import COMMAND_HISTORY, TICKS

EFFECT = Effect(
    'transport_delay',
    Stage.ACTUATOR,
    10,
    physics='The command reaches the servo late.',
    equation='u_servo(t) = u(t - delay_s)',
    source='Normey-Rico, Camacho, Control of Dead-time Processes, Springer 2007, ch. 2',
    parameters=(
        Parameter('delay_s', 's', 0.0, 0.5, 0.02, off=0.0, starts=(0.005, 0.03), comparable=True),
    ),
)
(DELAY,) = EFFECT.places


@hook(EFFECT, COMMAND)
@compiled
def late(p: Array, x: Array, command: float, history: Array, tick: float) -> float:
    """Mean of the delayed, held command over a tick: a continuous function of the delay."""
    return value_before(history[COMMAND_HISTORY], x[TICKS], p[DELAY], tick)

"""`tracker_delay`: the tracker's angle is late against its stamp."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import ANGLE_HISTORY, HISTORY, TICKS

DEFINITION = define(
    'tracker_delay',
    Stage.SENSING,
    physics="The tracker's angle is late against its stamp.",
    equation='reading(t) = q(t - delay_s)',
    source='Franz et al., IEEE Trans. Med. Imaging 33(8), 2014 (latency)',
    parameters=(
        EffectParameter(
            'delay_s', 's', 0.0, 0.5, 0.04, off=0.0, starts=(0.02, 0.06), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
DELAY = DEFINITION.first_parameter


@compiled
def reading(state: Array, parameters: Array, history: Array, tick: float) -> float:
    """Angle in rad that the joint had the delay ago, interpolated between ticks."""
    now = int(state[TICKS])
    # Without the cut a tick longer than usual would reach beyond what the ring still holds.
    place = max(0.0, now - min(parameters[DELAY] / tick, HISTORY - 2.0))
    index = int(place)
    older = history[ANGLE_HISTORY, index % HISTORY]
    newer = history[ANGLE_HISTORY, min(index + 1, now) % HISTORY]
    return older + (place - index) * (newer - older)

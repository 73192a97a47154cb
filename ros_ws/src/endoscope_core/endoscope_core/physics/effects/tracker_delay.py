"""`tracker_delay`: the tracker's angle is late against its stamp."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import value_before
from endoscope_core.physics.hooks import TRACKER, hook
from endoscope_core.physics.layout import ANGLE_HISTORY, TICKS

EFFECT = Effect(
    'tracker_delay',
    Stage.SENSING,
    10,
    physics="The tracker's angle is late against its stamp.",
    equation='reading(t) = q(t - delay_s)',
    source='Franz et al., IEEE Trans. Med. Imaging 33(8), 2014 (latency)',
    parameters=(
        Parameter('delay_s', 's', 0.0, 0.5, 0.04, off=0.0, starts=(0.02, 0.06), comparable=True),
    ),
    traits=Traits(of_device=True),
)
(DELAY,) = EFFECT.places


@hook(EFFECT, TRACKER)
@compiled
def late(p: Array, x: Array, angle: float, history: Array, time: float, tick: float) -> float:
    """Angle in rad that the tip had the delay ago; first of the tracker's effects."""
    return value_before(history[ANGLE_HISTORY], x[TICKS], p[DELAY], tick)

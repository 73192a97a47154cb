"""`tracker_bias`: the tracker's angle has an offset."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage
from endoscope_core.physics.hooks import TRACKER, hook

EFFECT = Effect(
    'tracker_bias',
    Stage.SENSING,
    40,
    physics="The tracker's angle has an offset.",
    equation='reading = q + bias_rad',
    source='Franz et al., IEEE Trans. Med. Imaging 33(8), 2014 (static error)',
    parameters=(
        Parameter('bias_rad', 'rad', -1.0, 1.0, 0.05, off=0.0, starts=(0.02,), comparable=True),
    ),
)
(BIAS,) = EFFECT.places


@hook(EFFECT, TRACKER)
@compiled
def offset(p: Array, x: Array, angle: float, history: Array, time: float, tick: float) -> float:
    """Angle in rad as the tracker reads it."""
    return angle + p[BIAS]

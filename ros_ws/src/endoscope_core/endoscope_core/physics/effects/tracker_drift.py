"""`tracker_drift`: the tracker's angle drifts in time."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import TRACKER, hook

EFFECT = Effect(
    'tracker_drift',
    Stage.SENSING,
    30,
    physics="The tracker's angle drifts in time.",
    equation='reading = q + rate_rad_per_s t',
    source='Franz et al., IEEE Trans. Med. Imaging 33(8), 2014 (drift)',
    parameters=(
        Parameter(
            'rate_rad_per_s', 'rad/s', -0.1, 0.1, 0.003, off=0.0, starts=(0.001,), comparable=True
        ),
    ),
    traits=Traits(depends_on_time=True, families=('tracker_of_time',)),
)
(RATE,) = EFFECT.places


@hook(EFFECT, TRACKER)
@compiled
def drifted(p: Array, x: Array, angle: float, history: Array, time: float, tick: float) -> float:
    """Angle in rad as the tracker reads it at `time`."""
    return angle + p[RATE] * time

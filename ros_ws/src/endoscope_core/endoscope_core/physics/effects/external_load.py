"""`external_load`: a constant moment from some time on."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects import onset
from endoscope_core.physics.hooks import LOAD, hook

EFFECT = Effect(
    'external_load',
    Stage.JOINT,
    40,
    physics='A constant moment acts on the joint from some time on.',
    equation='tau = moment_nm after time_s, risen within duration_s around it: evenly, or if '
    'smooth along a half cosine',
    source='Step disturbance: De Luca, Mattone, IEEE ICRA 2005',
    parameters=(
        Parameter(
            'moment_nm', 'N m', -0.1, 0.1, 0.0008, off=0.0, starts=(0.0005,), comparable=True
        ),
        Parameter('time_s', 's', 0.0, 3600.0, 15.0, starts=onset.STARTS, comparable=True),
        Parameter('duration_s', 's', 0.0, 5.0, 0.0, starts=(0.05,)),
        Parameter('smooth', '-', 0.0, 1.0, 0.0, counted=True),
    ),
    traits=Traits(depends_on_time=True),
)
MOMENT, TIME, DURATION, SMOOTH = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Mean moment in N m over the tick around `time`; it does not depend on the step."""
    begun = onset.share_after(p[TIME], p[DURATION], p[SMOOTH], time, tick)
    return p[MOMENT] * begun, 0.0

"""`external_load`: a moment that comes at some time, and may go and come again."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import ONSETS, share_after
from endoscope_core.physics.hooks import LOAD, hook

EVER = 1e6
"""Longer than any recording, s."""
EFFECT = Effect(
    'external_load',
    Stage.JOINT,
    40,
    physics='A constant moment acts on the joint from some time on; it may go, and come again.',
    equation='tau = moment_nm after time_s for hold_s, again every period_s; it rises and falls '
    'within duration_s around those times: evenly, or if smooth along a half cosine',
    source='Step disturbance: De Luca, Mattone, IEEE ICRA 2005',
    parameters=(
        Parameter(
            'moment_nm', 'N m', -0.1, 0.1, 0.0008, off=0.0, starts=(0.0005,), comparable=True
        ),
        Parameter('time_s', 's', 0.0, 3600.0, 15.0, starts=ONSETS, comparable=True),
        Parameter('duration_s', 's', 0.0, 5.0, 0.0, starts=(0.05,)),
        Parameter(
            'smooth', '-', 0.0, 1.0, 0.0, counted=True, words=('changes evenly', 'changes smoothly')
        ),
        Parameter('hold_s', 's', 0.02, EVER, EVER, starts=(EVER, 2.0)),
        Parameter('period_s', 's', 0.04, EVER, EVER),
    ),
    traits=Traits(depends_on_time=True, families=('load_of_time',)),
)
MOMENT, TIME, DURATION, SMOOTH, HOLD, PERIOD = EFFECT.places


@hook(EFFECT, LOAD)
@compiled
def moment(
    p: Array, x: Array, angle: float, step: float, other: float, time: float, tick: float
) -> tuple[float, float]:
    """Mean moment in N m over the tick around `time`; it does not depend on the step."""
    ramp = tick + p[DURATION]
    latest = math.floor((time - p[TIME] + 0.5 * ramp) / p[PERIOD])
    held = 0.0
    # A pulse may still be falling while the next one rises, and a long one be held beyond it.
    for k in range(2):
        if latest >= k:
            held += _pulse(p, p[TIME] + (latest - k) * p[PERIOD], time, tick)
    return p[MOMENT] * min(1.0, held), 0.0


@compiled
def _pulse(p: Array, onset: float, time: float, tick: float) -> float:
    """Share of the moment that a single one of its stays gives."""
    begun = share_after(onset, p[DURATION], p[SMOOTH], time, tick)
    return begun - share_after(onset + p[HOLD], p[DURATION], p[SMOOTH], time, tick)

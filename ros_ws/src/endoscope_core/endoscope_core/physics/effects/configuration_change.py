"""`configuration_change`: the tube changes its shape during the recording."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import ONSETS, share_after
from endoscope_core.physics.hooks import EXPONENT, hook

EFFECT = Effect(
    'configuration_change',
    Stage.TRANSMISSION,
    70,
    physics='The tube changes its shape during the recording, and sheath friction jumps.',
    equation='phi(t) = phi before time_s, factor phi after, within duration_s around it: evenly, '
    'or if smooth along a half cosine',
    source='phi = mu Theta, Euler-Eytelwein: Kaneko et al., IEEE ICRA 1991',
    parameters=(
        Parameter('time_s', 's', 0.0, 3600.0, 15.0, starts=ONSETS, comparable=True),
        Parameter('factor', '-', 0.1, 8.0, 1.6, off=1.0, starts=(1.4,)),
        Parameter('duration_s', 's', 0.0, 5.0, 0.0, starts=(0.05,)),
        Parameter(
            'smooth', '-', 0.0, 1.0, 0.0, counted=True, words=('changes evenly', 'changes smoothly')
        ),
    ),
    traits=Traits(depends_on_time=True, families=('exponent_of_time',)),
)
TIME, FACTOR, DURATION, SMOOTH = EFFECT.places


@hook(EFFECT, EXPONENT)
@compiled
def factor(p: Array, x: Array, speed: float, time: float, tick: float) -> float:
    """Mean factor on the capstan exponent over the tick around `time`."""
    after = share_after(p[TIME], p[DURATION], p[SMOOTH], time, tick)
    return 1.0 + after * (p[FACTOR] - 1.0)

"""`pretension_loss`: the wires' pretension decays during the recording."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import LENGTH, hook
from endoscope_core.physics.layout import PRETENSION, REST_TENSION, WIRE_STIFFNESS

EFFECT = Effect(
    'pretension_loss',
    Stage.TRANSMISSION,
    20,
    physics='The pretension of both wires decays during the recording.',
    equation='T0(t) = max(0, T0 - rate_n_per_s span_s e(t) / e(span_s)), e(t) = 1 - '
    'exp(-t / time_constant_s): rate_n_per_s is the mean over span_s; both wires grow longer by '
    'the stretch that T0(t) lacks',
    source='Relaxation of tendon pretension: Palli et al., IEEE/ASME Trans. Mechatron. 17(6), 2012',
    parameters=(
        Parameter('rate_n_per_s', 'N/s', -1.0, 1.0, 0.04, off=0.0, starts=(0.03,), comparable=True),
        Parameter('time_constant_s', 's', 1.0, 1e12, 1e12, starts=(60.0,)),
        Parameter('span_s', 's', 1e-3, 1e6, 40.0, is_duration=True),
    ),
    traits=Traits(depends_on_time=True, families=('length_of_time',)),
)
RATE, TIME_CONSTANT, SPAN = EFFECT.places


@hook(EFFECT, LENGTH)
@compiled
def loosened(p: Array, x: Array, wire: int, time: float) -> float:
    """What has been added to each wire's length by `time`, m."""
    slowness = 1.0 / p[TIME_CONSTANT]
    share = math.expm1(-slowness * time) / math.expm1(-slowness * p[SPAN])
    lost = min(p[PRETENSION], p[RATE] * p[SPAN] * share)
    # Pretension is that at the motor; what it stretches is less, as friction holds it off.
    stretched = x[REST_TENSION] / p[PRETENSION] if p[PRETENSION] > 0.0 else 1.0
    return lost * stretched / p[WIRE_STIFFNESS]

"""`pretension_loss`: the wires' pretension decays during the recording."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'pretension_loss',
    Stage.TRANSMISSION,
    physics='The pretension of both wires decays during the recording.',
    equation='T0(t) = max(0, T0 - rate_n_per_s span_s e(t) / e(span_s)), e(t) = 1 - '
    'exp(-t / time_constant_s): rate_n_per_s is the mean over span_s',
    source='Relaxation of tendon pretension: Palli et al., IEEE/ASME Trans. Mechatron. 17(6), 2012',
    parameters=(
        EffectParameter(
            'rate_n_per_s', 'N/s', -1.0, 1.0, 0.04, off=0.0, starts=(0.03,), comparable=True
        ),
        EffectParameter('time_constant_s', 's', 1.0, 1e12, 1e12, starts=(60.0,)),
        EffectParameter('span_s', 's', 1e-3, 1e6, 40.0, is_duration=True),
    ),
)
ON = DEFINITION.flag
RATE = DEFINITION.first_parameter
TIME_CONSTANT = RATE + 1
SPAN = RATE + 2


@compiled
def left(parameters: Array, pretension: float, time: float) -> float:
    """Pretension in N that is left at `time`."""
    slowness = 1.0 / parameters[TIME_CONSTANT]
    share = math.expm1(-slowness * time) / math.expm1(-slowness * parameters[SPAN])
    return max(0.0, pretension - parameters[RATE] * parameters[SPAN] * share)

"""`pretension_loss`: the wires' pretension decays during the recording."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'pretension_loss',
    Stage.TRANSMISSION,
    physics='The pretension of both wires decays during the recording.',
    equation='T0(t) = max(0, T0 - rate_n_per_s t)',
    source='Relaxation of tendon pretension: Palli et al., IEEE/ASME Trans. Mechatron. 17(6), 2012',
    parameters=(
        EffectParameter(
            'rate_n_per_s', 'N/s', -1.0, 1.0, 0.04, off=0.0, starts=(0.03,), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
RATE = DEFINITION.first_parameter


@compiled
def left(parameters: Array, pretension: float, time: float) -> float:
    """Pretension in N that is left at `time`."""
    return max(0.0, pretension - parameters[RATE] * time)

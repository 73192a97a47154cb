"""`configuration_change`: the tube changes its shape during the recording."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects import onset
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'configuration_change',
    Stage.TRANSMISSION,
    physics='The tube changes its shape during the recording, and sheath friction jumps.',
    equation='phi(t) = phi before time_s, factor phi after, within duration_s around it: evenly, '
    'or if smooth along a half cosine',
    source='phi = mu Theta, Euler-Eytelwein: Kaneko et al., IEEE ICRA 1991',
    parameters=(
        EffectParameter(
            'time_s',
            's',
            0.0,
            3600.0,
            15.0,
            starts=onset.STARTS,
            comparable=True,
        ),
        EffectParameter('factor', '-', 0.1, 8.0, 1.6, off=1.0, starts=(1.4,)),
        EffectParameter('duration_s', 's', 0.0, 5.0, 0.0, starts=(0.05,)),
        EffectParameter('smooth', '-', 0.0, 1.0, 0.0, counted=True),
    ),
)
ON = DEFINITION.flag
TIME = DEFINITION.first_parameter
FACTOR = TIME + 1
DURATION = TIME + 2
SMOOTH = TIME + 3


@compiled
def friction_factor(parameters: Array, time: float, tick: float) -> float:
    """Mean factor on the capstan exponent over the tick around `time`."""
    after = onset.share_after(
        parameters[TIME], parameters[DURATION], parameters[SMOOTH], time, tick
    )
    return 1.0 + after * (parameters[FACTOR] - 1.0)

"""`tracker_bias`: the tracker's angle has an offset."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'tracker_bias',
    Stage.SENSING,
    physics="The tracker's angle has an offset.",
    equation='reading = q + bias_rad',
    source='Franz et al., IEEE Trans. Med. Imaging 33(8), 2014 (static error)',
    parameters=(
        EffectParameter(
            'bias_rad', 'rad', -1.0, 1.0, 0.05, off=0.0, starts=(0.02,), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
BIAS = DEFINITION.first_parameter


@compiled
def reading(parameters: Array, angle: float) -> float:
    """Angle in rad as the tracker reads it."""
    return angle + parameters[BIAS]

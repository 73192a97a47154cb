"""`tracker_drift`: the tracker's angle drifts in time."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'tracker_drift',
    Stage.SENSING,
    physics="The tracker's angle drifts in time.",
    equation='reading = q + rate_rad_per_s t',
    source='Franz et al., IEEE Trans. Med. Imaging 33(8), 2014 (drift)',
    parameters=(
        EffectParameter(
            'rate_rad_per_s', 'rad/s', -0.1, 0.1, 0.003, off=0.0, starts=(0.001,), comparable=True
        ),
    ),
)
ON = DEFINITION.flag
RATE = DEFINITION.first_parameter


@compiled
def reading(parameters: Array, angle: float, time: float) -> float:
    """Angle in rad as the tracker reads it at `time`."""
    return angle + parameters[RATE] * time

"""`load_cell_drift`: the load cell's zero drifts."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'load_cell_drift',
    Stage.SENSING,
    physics="One load cell's zero drifts.",
    equation='reading of cell `wire` = T + rate_n_per_s t',
    source='VDI/VDE 2638, characteristics of force transducers (zero drift)',
    parameters=(
        EffectParameter(
            'rate_n_per_s', 'N/s', -1.0, 1.0, 0.05, off=0.0, starts=(0.02,), comparable=True
        ),
        EffectParameter('wire', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
RATE = DEFINITION.first_parameter
WIRE = RATE + 1


@compiled
def reading(parameters: Array, tension: float, time: float) -> float:
    """Tension in N as the faulty cell reads it at `time`."""
    return tension + parameters[RATE] * time

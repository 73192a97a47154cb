"""`load_cell_saturation`: the load cell clips."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'load_cell_saturation',
    Stage.SENSING,
    physics='One load cell clips.',
    equation='reading of cell `wire` = min(T, limit_n)',
    source='VDI/VDE 2638, characteristics of force transducers (overload)',
    parameters=(
        EffectParameter(
            'limit_n', 'N', 0.1, 500.0, 10.0, off=500.0, starts=(6.0, 10.0), comparable=True
        ),
        EffectParameter('wire', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
LIMIT = DEFINITION.first_parameter
WIRE = LIMIT + 1


@compiled
def reading(parameters: Array, tension: float) -> float:
    """Tension in N as the faulty cell reads it."""
    return min(tension, parameters[LIMIT])

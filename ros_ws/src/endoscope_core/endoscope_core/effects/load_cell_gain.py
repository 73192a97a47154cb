"""`load_cell_gain`: the load cell reads wrong by a factor."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'load_cell_gain',
    Stage.SENSING,
    physics='One load cell reads wrong by a factor.',
    equation='reading of cell `wire` = gain T',
    source='VDI/VDE 2638, characteristics of force transducers (gain error)',
    parameters=(
        EffectParameter('gain', '-', 0.2, 3.0, 1.15, off=1.0, starts=(1.05,), comparable=True),
        EffectParameter('wire', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
GAIN = DEFINITION.first_parameter
WIRE = GAIN + 1


@compiled
def reading(parameters: Array, tension: float) -> float:
    """Tension in N as the faulty cell reads it."""
    return parameters[GAIN] * tension

"""`load_cell_crosstalk`: a load cell sees its neighbour."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'load_cell_crosstalk',
    Stage.SENSING,
    physics='One load cell sees a share of its neighbour.',
    equation='reading of cell `wire` = T + share T_neighbour',
    source='VDI/VDE 2638, characteristics of force transducers (crosstalk)',
    parameters=(
        EffectParameter('share', '-', -0.9, 0.9, 0.1, off=0.0, starts=(0.05,)),
        EffectParameter('wire', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
SHARE = DEFINITION.first_parameter
WIRE = SHARE + 1


@compiled
def reading(parameters: Array, tension: float, neighbour: float) -> float:
    """Tension in N as the faulty cell reads it."""
    return tension + parameters[SHARE] * neighbour

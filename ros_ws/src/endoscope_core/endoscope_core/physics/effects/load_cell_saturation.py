"""`load_cell_saturation`: the load cell clips."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Symptom, Traits
from endoscope_core.physics.effects.laws import ONE_CELL
from endoscope_core.physics.hooks import LOAD_CELL, hook

EFFECT = Effect(
    'load_cell_saturation',
    Stage.SENSING,
    90,
    physics='One load cell clips.',
    equation='reading of cell `wire` = min(T, limit_n)',
    source='VDI/VDE 2638, characteristics of force transducers (overload)',
    parameters=(
        Parameter(
            'limit_n', 'N', 0.1, 500.0, 7.0, off=500.0, starts=(5.5, 7.0, 9.0), comparable=True
        ),
        ONE_CELL,
    ),
    traits=Traits(symptom=Symptom.CLIPPED_TENSION),
)
LIMIT, WIRE = EFFECT.places


@hook(EFFECT, LOAD_CELL)
@compiled
def clipped(p: Array, x: Array, reading: float, cell: int, neighbour: float, time: float) -> float:
    """Tension in N as the cell reads it."""
    return min(reading, p[LIMIT]) if cell == p[WIRE] else reading

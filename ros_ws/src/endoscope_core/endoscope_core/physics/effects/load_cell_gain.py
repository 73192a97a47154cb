"""`load_cell_gain`: the load cell reads wrong by a factor."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import ONE_CELL
from endoscope_core.physics.hooks import LOAD_CELL, hook

EFFECT = Effect(
    'load_cell_gain',
    Stage.SENSING,
    70,
    physics='One load cell reads wrong by a factor.',
    equation='reading of cell `wire` = gain T',
    source='VDI/VDE 2638, characteristics of force transducers (gain error)',
    parameters=(
        Parameter('gain', '-', 0.2, 3.0, 1.15, off=1.0, starts=(1.05,), comparable=True),
        ONE_CELL,
    ),
    traits=Traits(families=('load_cell_pos_of_tension', 'load_cell_neg_of_tension')),
)
GAIN, WIRE = EFFECT.places


@hook(EFFECT, LOAD_CELL)
@compiled
def scaled(p: Array, x: Array, reading: float, cell: int, neighbour: float, time: float) -> float:
    """Tension in N as the cell reads it."""
    return p[GAIN] * reading if cell == p[WIRE] else reading

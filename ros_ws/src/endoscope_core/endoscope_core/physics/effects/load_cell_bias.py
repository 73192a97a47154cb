"""`load_cell_bias`: the load cell reads something where there is no tension."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import ONE_CELL
from endoscope_core.physics.hooks import LOAD_CELL, hook

EFFECT = Effect(
    'load_cell_bias',
    Stage.SENSING,
    75,
    physics="One load cell's zero is off: it reads something where there is no tension.",
    equation='reading of cell `wire` = T + bias_n',
    source='VDI/VDE 2638, characteristics of force transducers (zero signal)',
    parameters=(
        Parameter('bias_n', 'N', -5.0, 5.0, 0.3, off=0.0, starts=(0.1,), comparable=True),
        ONE_CELL,
    ),
    traits=Traits(families=('load_cell_pos_of_tension', 'load_cell_neg_of_tension')),
)
BIAS, WIRE = EFFECT.places


@hook(EFFECT, LOAD_CELL)
@compiled
def biased(p: Array, x: Array, reading: float, cell: int, neighbour: float, time: float) -> float:
    """Tension in N as the cell reads it."""
    return reading + p[BIAS] if cell == p[WIRE] else reading

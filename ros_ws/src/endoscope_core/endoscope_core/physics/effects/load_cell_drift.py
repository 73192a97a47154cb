"""`load_cell_drift`: the load cell's zero drifts."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import ONE_CELL
from endoscope_core.physics.hooks import LOAD_CELL, hook

EFFECT = Effect(
    'load_cell_drift',
    Stage.SENSING,
    80,
    physics="One load cell's zero drifts.",
    equation='reading of cell `wire` = T + rate_n_per_s t',
    source='VDI/VDE 2638, characteristics of force transducers (zero drift)',
    parameters=(
        Parameter('rate_n_per_s', 'N/s', -1.0, 1.0, 0.05, off=0.0, starts=(0.02,), comparable=True),
        ONE_CELL,
    ),
    traits=Traits(
        depends_on_time=True, families=('load_cell_pos_of_time', 'load_cell_neg_of_time')
    ),
)
RATE, WIRE = EFFECT.places


@hook(EFFECT, LOAD_CELL)
@compiled
def drifted(p: Array, x: Array, reading: float, cell: int, neighbour: float, time: float) -> float:
    """Tension in N as the cell reads it at `time`."""
    return reading + p[RATE] * time if cell == p[WIRE] else reading

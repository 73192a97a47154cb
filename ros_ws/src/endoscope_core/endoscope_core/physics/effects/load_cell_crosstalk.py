"""`load_cell_crosstalk`: a load cell sees its neighbour."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import LOAD_CELL, hook

EFFECT = Effect(
    'load_cell_crosstalk',
    Stage.SENSING,
    60,
    physics='One load cell sees a share of its neighbour, or both see a share of each other.',
    equation='reading of cell `wire`, of both if that is 2, = T + share T_neighbour',
    source='VDI/VDE 2638, characteristics of force transducers (crosstalk)',
    parameters=(
        Parameter('share', '-', -0.9, 0.9, 0.1, off=0.0, starts=(0.05,)),
        Parameter(
            'wire',
            '-',
            0.0,
            2.0,
            0.0,
            choices=(0.0, 1.0, 2.0),
            words=('the cell of the positive wire', 'the cell of the negative wire', 'both cells'),
        ),
    ),
    traits=Traits(families=('load_cell_pos_of_other_wire', 'load_cell_neg_of_other_wire')),
)
SHARE, WIRE = EFFECT.places


@hook(EFFECT, LOAD_CELL)
@compiled
def mixed(p: Array, x: Array, reading: float, cell: int, neighbour: float, time: float) -> float:
    """Tension in N as the cell reads it."""
    if p[WIRE] == 2.0 or cell == p[WIRE]:
        return reading + p[SHARE] * neighbour
    return reading

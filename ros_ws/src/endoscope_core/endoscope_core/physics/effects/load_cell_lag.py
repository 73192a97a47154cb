"""`load_cell_lag`: the cells or their amplifier have a low-pass of their own."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import CELL_INPUT, hook
from endoscope_core.physics.layout import SLOTS, TICKS

EFFECT = Effect(
    'load_cell_lag',
    Stage.SENSING,
    54,
    physics='The load cells, or their amplifier, follow the tension with a first-order lag.',
    equation="reading' = (T - reading) / time_constant_s of both cells",
    source='Ogata, Modern Control Engineering, 5th ed. 2010, sec. 5-2',
    parameters=(
        Parameter(
            'time_constant_s', 's', 0.0, 1.0, 0.05, off=0.0, starts=(0.02, 0.15), comparable=True
        ),
    ),
    traits=Traits(of_device=True),
)
(TIME_CONSTANT,) = EFFECT.places
LAGGED, BEFORE, READ_AT = SLOTS.state_block(2), SLOTS.state_block(2), SLOTS.state_block(2)


@hook(EFFECT, CELL_INPUT)
@compiled
def lagged(p: Array, x: Array, tension: float, cell: int, history: Array, tick: float) -> float:
    """Tension in N as a cell reads it that went straight from the last tick's to `tension`."""
    # Sensors may be read twice in a tick, and a lag goes on once.
    now = x[TICKS] + 1.0
    if p[TIME_CONSTANT] <= 0.0 or x[READ_AT + cell] == 0.0:
        x[LAGGED + cell] = tension
    elif x[READ_AT + cell] != now:
        ratio = tick / p[TIME_CONSTANT]
        kept = math.exp(-ratio)
        share = -math.expm1(-ratio) / ratio
        change = (1.0 - share) * tension + (share - kept) * x[BEFORE + cell]
        x[LAGGED + cell] = kept * x[LAGGED + cell] + change
    x[BEFORE + cell], x[READ_AT + cell] = tension, now
    return x[LAGGED + cell]

"""`load_cell_delay`: tensions are late against their stamps."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.effects.laws import value_before
from endoscope_core.physics.hooks import CELL_INPUT, hook
from endoscope_core.physics.layout import TENSION_HISTORY, TICKS

EFFECT = Effect(
    'load_cell_delay',
    Stage.SENSING,
    52,
    physics="The load cells' tensions are late against their stamps: converter, averaging, bus.",
    equation='reading(t) = T(t - delay_s) of both cells',
    source='Proakis, Manolakis, Digital Signal Processing, 4th ed. 2007, sec. 10.2 (a filter of '
    'linear phase delays by half its length)',
    parameters=(
        Parameter(
            'delay_s', 's', 0.0, 0.5, 0.05, off=0.0, starts=(0.02, 0.06, 0.15), comparable=True
        ),
    ),
    traits=Traits(of_device=True),
)
(DELAY,) = EFFECT.places


@hook(EFFECT, CELL_INPUT)
@compiled
def late(p: Array, x: Array, tension: float, cell: int, history: Array, tick: float) -> float:
    """Tension in N of the delay ago; first of the load cells' effects."""
    return value_before(history[TENSION_HISTORY + cell], x[TICKS], p[DELAY], tick)

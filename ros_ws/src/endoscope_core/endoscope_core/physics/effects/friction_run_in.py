"""`friction_run_in`: sheath friction falls with the distance slid."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import ADVANCE, EXPONENT, hook
from endoscope_core.physics.layout import SLIDING_SPEED, SLOTS

EFFECT = Effect(
    'friction_run_in',
    Stage.TRANSMISSION,
    90,
    physics='Sheath friction falls with the distance slid: warm-up, lubrication, wear.',
    equation='phi(d) = phi (1 + excess (1 + tail d / distance_m)^(-1 / tail)), d = integral of '
    '|v|; with tail 0 exp(-d / distance_m)',
    source='Blau, Tribology International 38, 2005 (running-in)',
    parameters=(
        Parameter('excess', '-', -0.8, 5.0, 0.5, off=0.0, starts=(0.4,)),
        Parameter('distance_m', 'm', 1e-4, 2.0, 0.01, starts=(3e-3, 0.01, 0.03)),
        Parameter('tail', '-', 0.0, 3.0, 0.0, starts=(0.3,)),
    ),
    traits=Traits(
        depends_on_time=True, rescales=('capstan_exponent', 1.8), families=('exponent_of_distance',)
    ),
)
EXCESS, LENGTH, TAIL = EFFECT.places
LEAST_TAIL = 1e-9
DISTANCE = SLOTS.state_block()


@hook(EFFECT, EXPONENT)
@compiled
def factor(p: Array, x: Array, speed: float, time: float, tick: float) -> float:
    """Factor on the capstan exponent after the distance slid so far."""
    lengths = x[DISTANCE] / p[LENGTH]
    if p[TAIL] > LEAST_TAIL:
        lengths = math.log1p(p[TAIL] * lengths) / p[TAIL]
    return 1.0 + p[EXCESS] * math.exp(-lengths)


@hook(EFFECT, ADVANCE)
@compiled
def count(p: Array, x: Array, load_a: float, load_b: float, time: float, tick: float) -> None:
    """Count the distance slid in a tick."""
    x[DISTANCE] += abs(x[SLIDING_SPEED]) * tick

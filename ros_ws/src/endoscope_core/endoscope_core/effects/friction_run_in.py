"""`friction_run_in`: sheath friction falls with the distance slid."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS

DEFINITION = define(
    'friction_run_in',
    Stage.TRANSMISSION,
    physics='Sheath friction falls with the distance slid: warm-up, lubrication, wear.',
    equation='phi(d) = phi (1 + excess (1 + tail d / distance_m)^(-1 / tail)), d = integral of '
    '|v|; with tail 0 exp(-d / distance_m)',
    source='Blau, Tribology International 38, 2005 (running-in)',
    parameters=(
        EffectParameter('excess', '-', -0.8, 5.0, 0.5, off=0.0, starts=(0.4,)),
        EffectParameter('distance_m', 'm', 1e-3, 2.0, 0.03, starts=(0.01, 0.05)),
        EffectParameter('tail', '-', 0.0, 3.0, 0.0, starts=(0.3,)),
    ),
)
ON = DEFINITION.flag
EXCESS = DEFINITION.first_parameter
LENGTH = EXCESS + 1
TAIL = EXCESS + 2
LEAST_TAIL = 1e-9
DISTANCE = SLOTS.state_block()


@compiled
def friction_factor(state: Array, parameters: Array) -> float:
    """Factor on the capstan exponent after the distance slid so far."""
    lengths = state[DISTANCE] / parameters[LENGTH]
    tail = parameters[TAIL]
    if tail > LEAST_TAIL:
        lengths = math.log1p(tail * lengths) / tail
    return 1.0 + parameters[EXCESS] * math.exp(-lengths)


@compiled
def advance(state: Array, slid: float) -> None:
    """Count a distance slid in m."""
    state[DISTANCE] += abs(slid)

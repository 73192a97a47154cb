"""`friction_run_in`: sheath friction falls with the distance slid."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS

DEFINITION = define(
    'friction_run_in',
    Stage.TRANSMISSION,
    physics='Sheath friction falls with the distance slid: warm-up, lubrication, wear.',
    equation='phi(d) = phi (1 + excess exp(-d / distance_m)), d = integral of |v|',
    source='Blau, Tribology International 38, 2005 (running-in)',
    parameters=(
        EffectParameter('excess', '-', -0.8, 5.0, 0.5, off=0.0, starts=(0.4,)),
        EffectParameter('distance_m', 'm', 1e-3, 2.0, 0.03, starts=(0.01, 0.05)),
    ),
)
ON = DEFINITION.flag
EXCESS = DEFINITION.first_parameter
LENGTH = EXCESS + 1
DISTANCE = SLOTS.state_block()


@compiled
def friction_factor(state: Array, parameters: Array) -> float:
    """Factor on the capstan exponent after the distance slid so far."""
    return 1.0 + parameters[EXCESS] * math.exp(-state[DISTANCE] / parameters[LENGTH])


@compiled
def advance(state: Array, slid: float) -> None:
    """Count a distance slid in m."""
    state[DISTANCE] += abs(slid)

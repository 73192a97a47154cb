"""`presliding_shape`: friction builds up with displacement in another shape than Dahl's."""

import math

import numpy as np

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import dahl
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS

DEFINITION = define(
    'presliding_shape',
    Stage.TRANSMISSION,
    physics='Friction builds up with displacement sharper or softer than exponentially, or with '
    'memory of inner loops.',
    equation='z = (1 - memory) d + memory mean_j clip(x / (xs reach g_j^spread)); '
    "d' = (v / xs) |1 - d sgn v|^exponent",
    source='Dahl, AIAA J. 14(12), 1976 (exponent); Iwan, J. Appl. Mech. 33(4), 1966 (elements in '
    'parallel); Al-Bender, Lampaert, Swevers, IEEE Trans. Autom. Control 50(11), 2005',
    parameters=(
        EffectParameter('exponent', '-', 0.1, 4.0, 1.8, off=1.0, starts=(0.5, 2.0)),
        EffectParameter('memory', '-', 0.0, 1.0, 0.0, off=0.0, starts=(0.1, 0.7)),
        EffectParameter('spread', '-', 0.2, 3.0, 1.0),
        EffectParameter('reach', '-', 0.2, 3.0, 1.0),
        EffectParameter('at_joint', '-', 0.0, 1.0, 0.0, choices=(0.0, 1.0)),
    ),
)
ON = DEFINITION.flag
EXPONENT = DEFINITION.first_parameter
MEMORY = EXPONENT + 1
SPREAD = EXPONENT + 2
REACH = EXPONENT + 3
AT_JOINT = EXPONENT + 4

YIELD = np.array([0.4771, 0.9613, 1.4247, 1.9610, 2.6926, 4.1176])
"""Yield displacements of equal Maxwell-slip elements, in pre-sliding distances: the middles of
equal shares of the density x exp(-x), whose virgin curve is Dahl's 1 - exp(-x)."""
ELEMENTS = len(YIELD)
WIRE_A = SLOTS.state_block(1 + ELEMENTS)
WIRE_B = SLOTS.state_block(1 + ELEMENTS)
JOINT = SLOTS.state_block(1 + ELEMENTS)
"""Of each place: the state of the power-law Dahl part, then those of the elements."""
STIFFNESS = SLOTS.state_block(ELEMENTS)
"""Growth of each element by displacement in pre-sliding distances: inverse yield displacements."""


@compiled
def acts(parameters: Array, on: Flags, place: int) -> bool:
    """Whether the effect is on at a place."""
    return on[ON] and (parameters[AT_JOINT] > 0.5) == (place == JOINT)


@compiled
def prepare(state: Array, parameters: Array) -> None:
    """Set what does not change while a joint moves."""
    for j in range(ELEMENTS):
        state[STIFFNESS + j] = YIELD[j] ** -parameters[SPREAD] / parameters[REACH]


@compiled
def steepness(state: Array, parameters: Array, place: int, way: float) -> float:
    """Growth of the friction state by displacement in pre-sliding distances, towards `way`."""
    rest = max(0.0, 1.0 - state[place] * way)
    power = min(rest ** parameters[EXPONENT], 10.0) if rest > 0.0 else 0.0
    elastic = 0.0
    for j in range(ELEMENTS):
        if state[place + 1 + j] * way < 1.0:
            elastic += state[STIFFNESS + j]
    memory = parameters[MEMORY]
    return (1.0 - memory) * power + memory * elastic / ELEMENTS


@compiled
def slid(state: Array, parameters: Array, place: int, ratio: float) -> float:
    """Friction state after sliding `ratio` pre-sliding distances (signed)."""
    excess = parameters[EXPONENT] - 1.0
    way = 1.0 if ratio > 0.0 else -1.0
    rest = 1.0 - state[place] * way
    if abs(excess) < 1e-6:
        state[place] = dahl.slid(state[place], ratio, 0.0)
    elif rest > 0.0:
        state[place] = way * (1.0 - _rest_after(rest, abs(ratio), excess))
    mean = 0.0
    for j in range(ELEMENTS):
        element = min(1.0, max(-1.0, state[place + 1 + j] + ratio * state[STIFFNESS + j]))
        state[place + 1 + j] = element
        mean += element / ELEMENTS
    memory = parameters[MEMORY]
    return (1.0 - memory) * state[place] + memory * mean


@compiled
def _rest_after(rest: float, size: float, excess: float) -> float:
    """Exact solution of rest' = -rest^(1 + excess) after a displacement of `size`."""
    rate = size * rest**excess
    argument = excess * rate
    if argument <= -1.0:
        return 0.0
    return rest * math.exp(-math.log1p(argument) / excess)

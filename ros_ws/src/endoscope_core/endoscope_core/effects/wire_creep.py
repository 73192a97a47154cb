"""`wire_creep`: viscoelastic wires, whose stretch goes on under load."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS, WIRE_STIFFNESS

DEFINITION = define(
    'wire_creep',
    Stage.TRANSMISSION,
    physics='Wire and sheath are viscoelastic: the stretch goes on under load.',
    equation="T = T0 + k (s - c - d); time_constant_s c' = (1 - slow_share) compliance_ratio "
    "(T - T0) / k - c; slow_time_constant_s d' = slow_share compliance_ratio (T - T0) / k - d",
    source='Kelvin-Voigt elements in series: Findley, Lai, Onaran, Creep and Relaxation of '
    'Nonlinear Viscoelastic Materials, 1976, ch. 5',
    parameters=(
        EffectParameter('compliance_ratio', '-', 0.0, 5.0, 0.3, off=0.0, starts=(0.2,)),
        EffectParameter('time_constant_s', 's', 0.02, 60.0, 2.0, starts=(0.3, 1.5, 8.0)),
        EffectParameter('slow_share', '-', 0.0, 1.0, 0.0, starts=(0.3,)),
        EffectParameter('slow_time_constant_s', 's', 1.0, 200.0, 8.0),
    ),
)
ON = DEFINITION.flag
RATIO = DEFINITION.first_parameter
TIME_CONSTANT = RATIO + 1
SLOW_SHARE = RATIO + 2
SLOW_TIME_CONSTANT = RATIO + 3
CREEP_A = SLOTS.state_block()
"""Stretch of the positive wire by creep in m, of both elements."""
CREEP_B = SLOTS.state_block()
SLOW_A = SLOTS.state_block()
SLOW_B = SLOTS.state_block()


@compiled
def _creep(
    state: Array,
    parameters: Array,
    both: int,
    slow: int,
    load: float,
    fast_way: float,
    slow_way: float,
) -> None:
    """Let one wire creep its ways' shares; `both` and `slow` are places of its states."""
    compliance = parameters[RATIO] / parameters[WIRE_STIFFNESS] * load
    fast_part = state[both] - state[slow]
    fast_part += fast_way * ((1.0 - parameters[SLOW_SHARE]) * compliance - fast_part)
    state[slow] += slow_way * (parameters[SLOW_SHARE] * compliance - state[slow])
    state[both] = fast_part + state[slow]


@compiled
def advance(state: Array, parameters: Array, load_a: float, load_b: float, duration: float) -> None:
    """Let both wires creep under their tensions above pretension in N."""
    fast_way = -math.expm1(-duration / parameters[TIME_CONSTANT])
    slow_way = -math.expm1(-duration / parameters[SLOW_TIME_CONSTANT])
    _creep(state, parameters, CREEP_A, SLOW_A, load_a, fast_way, slow_way)
    _creep(state, parameters, CREEP_B, SLOW_B, load_b, fast_way, slow_way)

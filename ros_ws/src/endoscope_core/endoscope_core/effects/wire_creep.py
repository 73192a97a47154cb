"""`wire_creep`: viscoelastic wires, whose stretch goes on under load."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define
from endoscope_core.effects.slots import SLOTS, WIRE_STIFFNESS

DEFINITION = define(
    'wire_creep',
    Stage.TRANSMISSION,
    physics='Wire and sheath are viscoelastic: the stretch goes on under load.',
    equation="T = T0 + k (s - c); time_constant_s c' = compliance_ratio (T - T0) / k - c",
    source='Standard linear solid (Kelvin-Voigt element in series): Findley, Lai, Onaran, '
    'Creep and Relaxation of Nonlinear Viscoelastic Materials, 1976, ch. 5',
    parameters=(
        EffectParameter('compliance_ratio', '-', 0.0, 5.0, 0.3, off=0.0, starts=(0.2,)),
        EffectParameter('time_constant_s', 's', 0.02, 60.0, 2.0, starts=(0.3, 1.5, 8.0)),
    ),
)
ON = DEFINITION.flag
RATIO = DEFINITION.first_parameter
TIME_CONSTANT = RATIO + 1
CREEP_A = SLOTS.state_block()
CREEP_B = SLOTS.state_block()


@compiled
def advance(state: Array, parameters: Array, load_a: float, load_b: float, duration: float) -> None:
    """Let both wires creep under their tensions above pretension in N."""
    share = -math.expm1(-duration / parameters[TIME_CONSTANT])
    compliance = parameters[RATIO] / parameters[WIRE_STIFFNESS]
    state[CREEP_A] += share * (compliance * load_a - state[CREEP_A])
    state[CREEP_B] += share * (compliance * load_b - state[CREEP_B])

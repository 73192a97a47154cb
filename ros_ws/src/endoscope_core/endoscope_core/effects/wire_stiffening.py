"""`wire_stiffening`: the wires' stiffness grows with their stretch."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.effects.definition import EffectParameter, Stage, define

DEFINITION = define(
    'wire_stiffening',
    Stage.TRANSMISSION,
    physics='The stiffness of the wires grows with their stretch.',
    equation='T = T0 + k ((exp(2 a s) - 1) / (2 a) + b s^3); a = growth_per_m, b = cubic_per_m2',
    source='Fung, Biomechanics, 2nd ed. 1993, sec. 7.5 (exponential); Duffing hardening (cubic)',
    parameters=(
        EffectParameter('growth_per_m', '1/m', 0.0, 500.0, 80.0, off=0.0, starts=(50.0,)),
        EffectParameter('cubic_per_m2', '1/m^2', 0.0, 5e5, 0.0, off=0.0, starts=(1e3,)),
    ),
)
ON = DEFINITION.flag
GROWTH = DEFINITION.first_parameter
CUBIC = GROWTH + 1
LARGEST_EXPONENT = 2.0
"""Where the exponential goes on as its tangent; no wire is stretched that far."""


@compiled
def linear_equivalent(parameters: Array, stretch: float) -> tuple[float, float]:
    """Stretch in m of a linear wire with the same tension, and its slope by the true stretch."""
    cubic = parameters[CUBIC] * stretch * stretch
    rate = 2.0 * parameters[GROWTH]
    exponent = rate * stretch
    if exponent > LARGEST_EXPONENT:
        slope = math.exp(LARGEST_EXPONENT)
        return (
            math.expm1(LARGEST_EXPONENT) / rate
            + slope * (stretch - LARGEST_EXPONENT / rate)
            + cubic * stretch,
            slope + 3.0 * cubic,
        )
    if abs(exponent) < 1e-6:
        return stretch * (1.0 + 0.5 * exponent + cubic), 1.0 + exponent + 3.0 * cubic
    grown = math.expm1(exponent)
    return grown / rate + cubic * stretch, 1.0 + grown + 3.0 * cubic

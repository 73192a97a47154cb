"""`wire_stiffening`: the wires' stiffness grows with their stretch."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import STIFFNESS, hook
from endoscope_core.physics.layout import REST_TENSION, WIRE_STIFFNESS

EFFECT = Effect(
    'wire_stiffening',
    Stage.TRANSMISSION,
    50,
    physics='The stiffness of the wires grows with their stretch.',
    equation='mean of T = that at rest + k ((exp(2 a s) - 1) / (2 a) + b s^3); a = growth_per_m, '
    'b = cubic_per_m2, s stretch since rest',
    source='Fung, Biomechanics, 2nd ed. 1993, sec. 7.5 (exponential); Duffing hardening (cubic)',
    parameters=(
        Parameter('growth_per_m', '1/m', 0.0, 500.0, 80.0, off=0.0, starts=(50.0,)),
        Parameter('cubic_per_m2', '1/m^2', 0.0, 5e6, 0.0, off=0.0, starts=(0.0, 1e5)),
    ),
    traits=Traits(families=('stiffness_of_tension',)),
)
GROWTH, CUBIC = EFFECT.places
LARGEST, LEAST = math.exp(2.0), 0.05
"""Factors at which the exponential goes on as its tangent; no wire is stretched that far."""
TRIES = 20


@hook(EFFECT, STIFFNESS)
@compiled
def factor(p: Array, x: Array, tension: float) -> float:
    """Factor on a wire's tangent stiffness at a mean tension in N."""
    linear = (tension - x[REST_TENSION]) / p[WIRE_STIFFNESS]
    rate, cubic = 2.0 * p[GROWTH], p[CUBIC]
    if cubic == 0.0:
        return min(LARGEST, max(LEAST, 1.0 + rate * linear))
    stretch = _cubic_stretch(linear, cubic)
    for _ in range(TRIES):
        value, slope = _exponential(rate, stretch)
        slope += 3.0 * cubic * stretch * stretch
        change = (value + cubic * stretch**3 - linear) / slope
        stretch -= change
        if abs(change) < 1e-12:
            break
    _, slope = _exponential(rate, stretch)
    return slope + 3.0 * cubic * stretch * stretch


@compiled
def _cubic_stretch(linear: float, cubic: float) -> float:
    """Stretch s in m for which s + cubic s^3 is `linear` (Vieta)."""
    root = math.sqrt(3.0 * cubic)
    return 2.0 / root * math.sinh(math.asinh(1.5 * root * linear) / 3.0)


@compiled
def _exponential(rate: float, stretch: float) -> tuple[float, float]:
    """Stretch in m of a linear wire with the same tension, and its slope by the true stretch."""
    if rate <= 0.0:
        return stretch, 1.0
    exponent = min(math.log(LARGEST), max(math.log(LEAST), rate * stretch))
    slope = math.exp(exponent)
    return math.expm1(exponent) / rate + slope * (stretch - exponent / rate), slope

"""`wire_creep`: viscoelastic wires, whose stretch goes on under load."""

import math

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.effect import Effect, Parameter, Stage, Traits
from endoscope_core.physics.hooks import ADVANCE, LENGTH, hook
from endoscope_core.physics.layout import REST_TENSION, SLOTS, WIRE_STIFFNESS

EFFECT = Effect(
    'wire_creep',
    Stage.TRANSMISSION,
    60,
    physics='Wire and sheath are viscoelastic: the stretch goes on under load.',
    equation="extension = F / k + c + d, F mean of T above that at rest; time_constant_s c' = "
    "(1 - slow_share) compliance_ratio F / k - c; slow_time_constant_s d' = slow_share "
    'compliance_ratio F / k - d',
    source='Kelvin-Voigt elements in series: Findley, Lai, Onaran, Creep and Relaxation of '
    'Nonlinear Viscoelastic Materials, 1976, ch. 5',
    parameters=(
        Parameter('compliance_ratio', '-', 0.0, 5.0, 0.3, off=0.0, starts=(0.2,)),
        Parameter('time_constant_s', 's', 0.02, 60.0, 2.0, starts=(0.3, 1.5, 8.0)),
        Parameter('slow_share', '-', 0.0, 1.0, 0.0, starts=(0.0, 0.3)),
        Parameter('slow_time_constant_s', 's', 1.0, 200.0, 8.0),
    ),
    traits=Traits(resembles_time=True, families=('length_of_lagging_tension',)),
)
RATIO, TIME_CONSTANT, SLOW_SHARE, SLOW_TIME_CONSTANT = EFFECT.places
FAST, SLOW = SLOTS.state_block(2), SLOTS.state_block(2)
"""Creep of each wire in m, in the quick and in the slow element."""


@hook(EFFECT, LENGTH)
@compiled
def crept(p: Array, x: Array, wire: int, time: float) -> float:
    """What a wire has crept, m."""
    return x[FAST + wire] + x[SLOW + wire]


@hook(EFFECT, ADVANCE)
@compiled
def creep(p: Array, x: Array, load_a: float, load_b: float, time: float, tick: float) -> None:
    """Let both wires creep for a tick, exactly where both their ends are held."""
    quick = _crept_share(p, tick / p[TIME_CONSTANT])
    slow = _crept_share(p, tick / p[SLOW_TIME_CONSTANT])
    for wire in range(2):
        load = (load_a if wire == 0 else load_b) - x[REST_TENSION]
        end = p[RATIO] * load / p[WIRE_STIFFNESS]
        x[FAST + wire] += quick * ((1.0 - p[SLOW_SHARE]) * end - x[FAST + wire])
        x[SLOW + wire] += slow * (p[SLOW_SHARE] * end - x[SLOW + wire])


@compiled
def _crept_share(p: Array, ticks: float) -> float:
    """Share of what is left that a wire creeps in a tick, as creep unloads the wire meanwhile."""
    return -math.expm1(-(1.0 + p[RATIO]) * ticks) / (1.0 + p[RATIO])

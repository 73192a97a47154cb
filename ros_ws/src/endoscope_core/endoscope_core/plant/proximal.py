"""Compiled tensions at the motor's end of the sheath: what loads servo and load cells."""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import (
    cross_coupling,
    distributed_friction,
    viscous_friction,
    wire_creep,
)
from endoscope_core.effects.slots import (
    JOINT_RADIUS,
    PRESLIDING_DISTANCE,
    PULLEY_RADIUS,
    SLIDE_A,
    SLIDE_B,
)
from endoscope_core.plant.inputs import IN_OTHER_JOINT, IN_PUSH_STRETCH
from endoscope_core.plant.sheath_chain import spring_tension
from endoscope_core.plant.transmission import half_exponent, is_distributed, wire_tension


@compiled
def stretch_shift(p: Array, on: Flags, x: Array) -> float:
    """Stretch in m of the positive wire that neither motor nor joint causes."""
    shift = x[IN_PUSH_STRETCH]
    if on[cross_coupling.ON]:
        shift += p[JOINT_RADIUS] * cross_coupling.wire_travel(p, x[IN_OTHER_JOINT])
    return shift


@compiled
def proximal_tensions(
    state: Array,
    p: Array,
    on: Flags,
    pretension: float,
    phi: float,
    speed: float,
    stretch: float,
    shift: float,
) -> tuple[float, float, float, float]:
    """Tensions in N at the motor, and the slopes of their torque by the motor's angle.

    Parameters
    ----------
    state, p, on : array (states,), array (parameters,), array (flags,) of bool
    pretension : float
        N.
    phi : float
        Capstan exponent of the whole sheath.
    speed : float
        Sliding speed in m/s.
    stretch, shift : float
        Stretch of the whole positive wire in m, and what of it neither motor nor joint causes.

    Returns
    -------
    positive, negative : float
        N.
    slope_up, slope_down : float
        N m per rad, joint-equivalent, if the motor turns up, and down.
    """
    ca, cb = state[wire_creep.CREEP_A], state[wire_creep.CREEP_B]
    if is_distributed(p, on):
        ta, ka = spring_tension(
            state, distributed_friction.WIRE_A, p, on, pretension, shift - ca, 0
        )
        tb, kb = spring_tension(
            state, distributed_friction.WIRE_B, p, on, pretension, -shift - cb, 0
        )
        phi *= 1.0 - p[distributed_friction.SHARE]
    else:
        ta, ka = wire_tension(p, on, pretension, stretch - ca)
        tb, kb = wire_tension(p, on, pretension, -stretch - cb)
    ea, grip_a = half_exponent(p, on, phi, state[SLIDE_A], speed)
    eb, grip_b = half_exponent(p, on, phi, state[SLIDE_B], -speed)
    ra, rb = math.exp(ea), math.exp(eb)
    film = 0.0
    if on[viscous_friction.ON]:
        film = 0.5 * viscous_friction.film(p, speed) * speed
    positive = max(0.0, ta * ra + film)
    negative = max(0.0, tb * rb - film)
    elastic = ka * ra + kb * rb
    sliding_a = grip_a * positive / p[PRESLIDING_DISTANCE] * 0.5
    sliding_b = grip_b * negative / p[PRESLIDING_DISTANCE] * 0.5
    za, zb = state[SLIDE_A], state[SLIDE_B]
    leverage = p[PULLEY_RADIUS] * p[JOINT_RADIUS]
    up = leverage * (elastic + sliding_a * max(0.0, 1.0 - za) + sliding_b * max(0.0, 1.0 + zb))
    down = leverage * (elastic + sliding_a * max(0.0, 1.0 + za) + sliding_b * max(0.0, 1.0 - zb))
    return positive, negative, up, down

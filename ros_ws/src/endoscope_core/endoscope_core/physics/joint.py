"""The bending joint: overdamped, with friction that builds up over an angle.

The symbols are those of the plant's equations: angle q, wire tensions Ta(Phi) and Tb(Phi) at the
joint, joint radius r, stiffness K, damping c, friction tau_f with Dahl state z, section friction mu
with the angle qs at which the section is straight, moment tau that effects add.
"""

import math
from typing import NamedTuple

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics import hooks
from endoscope_core.physics.folds import acting, folded
from endoscope_core.physics.layout import (
    ELEMENTS,
    EXTRA_END_LENGTH,
    FILM,
    FLOOR,
    JOINT,
    JOINT_DAMPING,
    JOINT_FRICTION,
    JOINT_PRESLIDING,
    JOINT_PRESLIDING_SPREAD,
    JOINT_RADIUS,
    JOINT_REST_ANGLE,
    JOINT_SLIDE,
    JOINT_STEP,
    JOINT_STIFFNESS,
    SECTION_FRICTION,
    SECTION_STRAIGHT_ANGLE,
    SLIDING_SPEED,
    WIRE_A,
    WIRE_B,
    WIRE_STIFFNESS,
)
from endoscope_core.physics.sheath import JOINT_END, mean_tension, move, moved

added_moment = folded(hooks.LOAD)
film_drag = folded(hooks.FILM_DRAG)
friction_factor = folded(hooks.JOINT_FRICTION_FACTOR)
end_length = folded(hooks.END_LENGTH)
stiffness_factor, stiffness_varies = folded(hooks.STIFFNESS), acting(hooks.STIFFNESS)

_TRIES = 100
_PRECISION = 1e-11
_FIRST_STEP = 1e-14
"""Rad: tells only which way the joint turns."""


class Tick(NamedTuple):
    """What stays as it is while the joint's balance in a tick is sought."""

    k_a: float  # stiffness of each wire, N/m
    k_b: float
    film: float  # viscous drag of the sheath on a wire, N s/m
    tau_f: float  # friction, N m
    w: float  # by how much the pulley has wound up the positive wire, m
    q_other: float  # the other joint's angle, rad
    time: float  # middle of the tick, s
    length: float  # s


@compiled
def secant_stiffness(x: Array, wire: int, table: Array, p: Array, on: Flags, dw: float) -> float:
    """Stiffness in N/m of a wire that is about to be stretched by `dw` m, in the middle of that."""
    # At its beginning it would be too small on every stretch and too large on every release, and
    # tension would leak away with every cycle.
    k = p[WIRE_STIFFNESS]
    if not stiffness_varies(on):
        return k
    middle = tension = mean_tension(x, wire, table) - x[FLOOR]
    factor = 1.0
    for _ in range(2):
        factor = stiffness_factor(on, p, x, middle)
        middle = max(0.0, tension + 0.5 * dw * k * factor)
    return k * factor


@compiled
def _dahl(z: float, dq: float, qs: float) -> tuple[float, float]:
    """Dahl state after a step, and its slope by the step."""
    # z' = (q' / qs) (1 - z sgn q'): Dahl, Aerospace Corp. TOR-0158(3107-18)-1, 1968. Exact for a
    # step of one sign s: z <- s + (z - s) exp(-|dq| / qs).
    s = 1.0 if dq >= 0.0 else -1.0
    left = math.exp(-abs(dq) / qs)
    return s + (z - s) * left, (1.0 - s * z) * left / qs


@compiled
def _presliding(p: Array, element: int) -> float:
    """Pre-sliding angle of one of the elements in rad."""
    return p[JOINT_PRESLIDING] * math.exp((element - 1) * p[JOINT_PRESLIDING_SPREAD])


@compiled
def _slide(x: Array, p: Array, dq: float) -> tuple[float, float]:
    """State z of the joint's friction after a step of the joint, and its slope."""
    if p[JOINT_PRESLIDING_SPREAD] == 0.0:
        return _dahl(x[JOINT_SLIDE], dq, p[JOINT_PRESLIDING])
    total, steep = 0.0, 0.0
    for i in range(ELEMENTS):
        z, slope = _dahl(x[JOINT_SLIDE + i], dq, _presliding(p, i))
        total += z
        steep += slope
    return total / ELEMENTS, steep / ELEMENTS


@compiled
def _section_friction(
    p: Array, q: float, t: float, by_q: float, z: float, by_step: float
) -> tuple[float, float]:
    """Moment in N m that the bending section takes from the wire on the inside, and its slope.

    `t` in N is that wire's tension at the joint, `by_q` its slope by the joint's angle; `z` is the
    state of the joint's friction, `by_step` its slope.
    """
    # Capstan friction over hinges that are bent by q - qs in all: T exp(-mu |q - qs|) where the
    # wire is pulled, T exp(mu |q - qs|) where it is let go (Kaneko et al., IEEE ICRA 1991), z in
    # between. The inner wire of a positive bend is pulled by a positive step.
    bend = p[SECTION_FRICTION] * (q - p[SECTION_STRAIGHT_ANGLE])
    left = math.exp(-bend * z)
    changes = -left * (p[SECTION_FRICTION] * z + bend * by_step)
    r = p[JOINT_RADIUS] if bend >= 0.0 else -p[JOINT_RADIUS]
    return r * t * (1.0 - left), r * (by_q * (1.0 - left) - t * changes)


@compiled
def imbalance(
    x: Array, table: Array, p: Array, on: Flags, now: Tick, dq: float
) -> tuple[float, float]:
    """What is missing in N m to bend by `dq`, and its slope."""
    # c q' = r (Ta(Phi) - Tb(Phi)) - K (q - q0) - tau_f z - tau_s + tau, implicit in q at the tick's
    # end, tau_s what the section takes. Viscous drag adds film / 2 times the mean sliding speed of
    # both ends to a wire's end.
    r = p[JOINT_RADIUS]
    q = x[JOINT] + dq
    t_a, slope_a, _, _, _, _ = moved(x, WIRE_A, table, JOINT_END, -now.k_a * r * dq, x[FLOOR])
    t_b, slope_b, _, _, _, _ = moved(x, WIRE_B, table, JOINT_END, now.k_b * r * dq, x[FLOOR])
    tau, slope = added_moment(on, p, x, q, dq, now.q_other, now.time, now.length)
    z, by_step = _slide(x, p, dq)
    friction, steep = now.tau_f * z, now.tau_f * by_step
    if p[SECTION_FRICTION] > 0.0:
        t, by_q = t_a - x[FLOOR], -now.k_a * r * slope_a
        if q < p[SECTION_STRAIGHT_ANGLE]:
            t, by_q = t_b - x[FLOOR], now.k_b * r * slope_b
        taken, by_angle = _section_friction(p, q, t, by_q, z, by_step)
        friction += taken
        steep += by_angle
    c = (p[JOINT_DAMPING] + 0.5 * r * r * now.film) / now.length
    tau += r * (t_a - t_b) - 0.5 * r * now.film * now.w / now.length
    tau -= p[JOINT_STIFFNESS] * (q - p[JOINT_REST_ANGLE]) + friction + c * dq
    slope += r * r * (now.k_a * slope_a + now.k_b * slope_b) + p[JOINT_STIFFNESS] + steep + c
    return -tau, slope


@compiled
def _step(x: Array, table: Array, p: Array, on: Flags, now: Tick) -> float:
    """By how much the joint bends, rad: Newton's method within a bracket."""
    # The nominal imbalance grows with the step and is concave on either side of zero, where fronts
    # and pre-sliding soften it: from the last step Newton's method comes to the root from one side.
    missing, slope = imbalance(x, table, p, on, now, 0.0)
    if missing == 0.0:
        return 0.0
    side = -1.0 if missing > 0.0 else 1.0
    near, far = 0.0, math.inf
    dq = x[JOINT_STEP] if x[JOINT_STEP] * side > 0.0 else side * _FIRST_STEP
    for _ in range(_TRIES):
        missing, slope = imbalance(x, table, p, on, now, dq)
        if missing * side <= 0.0:
            near = abs(dq)
        else:
            far = abs(dq)
        following = dq - missing / slope if slope > 0.0 else math.nan
        if not near <= side * following <= far:
            following = side * (2.0 * near if math.isinf(far) else 0.5 * (near + far))
        if abs(following - dq) <= _PRECISION:
            return following
        dq = following
    return dq


@compiled
def bend(
    x: Array, table: Array, p: Array, on: Flags, w: float, q_other: float, time: float, tick: float
) -> None:
    """Bend the joint to where it comes to rest at the end of a tick of length `tick` s.

    `w`: by how much the pulley has wound up the positive wire in this tick, m. `q_other`: the other
    joint's angle, rad. `time`: the middle of the tick, s. Only `x` is changed.
    """
    r = p[JOINT_RADIUS]
    # The step is not known yet: it will be much like the last one.
    ahead = r * x[JOINT_STEP]
    k_a = secant_stiffness(x, WIRE_A, table, p, on, -ahead)
    k_b = secant_stiffness(x, WIRE_B, table, p, on, ahead)
    # w(Phi) = +-(r q - what the other joint adds).
    length = end_length(on, p, x, q_other)
    if length != x[EXTRA_END_LENGTH]:
        move(x, WIRE_A, table, JOINT_END, k_a * (length - x[EXTRA_END_LENGTH]), x[FLOOR])
        move(x, WIRE_B, table, JOINT_END, k_b * (x[EXTRA_END_LENGTH] - length), x[FLOOR])
        x[EXTRA_END_LENGTH] = length
    film = film_drag(on, p, x, abs(x[SLIDING_SPEED]))
    tau_f = p[JOINT_FRICTION] * friction_factor(on, p, x)
    dq = _step(x, table, p, on, Tick(k_a, k_b, film, tau_f, w, q_other, time, tick))
    if dq != 0.0:
        move(x, WIRE_A, table, JOINT_END, -k_a * r * dq, x[FLOOR])
        move(x, WIRE_B, table, JOINT_END, k_b * r * dq, x[FLOOR])
        for i in range(ELEMENTS):
            x[JOINT_SLIDE + i], _ = _dahl(x[JOINT_SLIDE + i], dq, _presliding(p, i))
    x[SLIDING_SPEED] = 0.5 * (w + r * dq) / tick
    x[FILM] = film * x[SLIDING_SPEED]
    x[FILM + 1] = -x[FILM]
    x[JOINT] += dq
    x[JOINT_STEP] = dq

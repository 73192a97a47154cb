"""One joint whose sheath is a chain of springs with friction at every node, by implicit Euler.

The nodes of the positive wire, the joint, and the nodes of the negative wire in reverse are one
tridiagonal system, solved by Newton's method in every step (Kaneko et al. 1991, Proc. IEEE ICRA:
tendon in a sheath as lumped masses; here without mass, with the capstan law at each node).
"""

import math
from typing import Any

from endoscope_explain.generator.compiled_physics import compiled
from endoscope_explain.generator.lumped_joint import (
    AGE,
    CREEP_A1,
    CREEP_A2,
    CREEP_B1,
    CREEP_B2,
    DRUM,
    RATE,
    RELAXED,
    SLID,
    SLIP_SPEED,
    STATES,
    TIP,
    ZA,
    ZB,
    ZJ,
    slow_rates,
)
from endoscope_explain.generator.wire_and_joint_laws import (
    crimp_slip,
    joint_friction,
    joint_moment,
    joint_resistance,
    presliding_distance,
    sheath_factor,
    wire_tension,
)

NODE_DRAG = 2.0
NEWTON_STEPS = 12
TOLERANCE = 1e-9
PROBE = 1e-7
# Where the state vector keeps what only a chain needs.
LUMPED_A, LUMPED_B, WOUND = ZA + 1, ZB + 1, ZA + 2


@compiled
def _dahl_after(z: float, moved: float, distance: float) -> tuple[float, float]:
    """Exact Dahl state after `moved`, and its derivative by `moved`."""
    direction = 1.0 if moved >= 0.0 else -1.0
    left = (1.0 - direction * z) * math.exp(-abs(moved) / distance)
    return direction * (1.0 - left), left / distance


@compiled
def _segment(gap: float, count: int, time: float, rig: Any) -> tuple[float, float]:
    """Tension of one segment of `count` that is longer by `gap`, and its derivative."""
    tension = wire_tension(gap * count, time, rig)
    slope = (wire_tension((gap + PROBE) * count, time, rig) - tension) / PROBE
    return tension, slope


@compiled
def advance_chain(
    y: Any,
    nodes: Any,
    states: Any,
    shares: Any,
    work: Any,
    readings: Any,
    wire_in: float,
    other: float,
    time: float,
    step: float,
    rig: Any,
) -> None:
    """Advance the joint by one implicit step.

    Parameters
    ----------
    y
        State of `lumped_joint`, shape (STATES,); DRUM, TIP, RATE and the slow states are used.
    nodes, states
        Displacement (m) towards the motor, and Dahl state, of the nodes, each shape (2, N).
    shares
        Share of the capstan exponent at each node, shape (N,), sums to one.
    work
        Scratch, shape (8, 2 N + 1), zero before the first step and kept between steps.
    readings
        Output, shape (2,): tensions (N) at the load cells.
    wire_in
        Wound length (m) at the END of the step.
    other
        Bending (rad) of the other joint.
    time, step
        END and length of the step in seconds.
    rig
        The joint's record.
    """
    n = shares.size
    size = 2 * n + 1
    radius = rig.joint_radius
    x, low, mid, high, rest, x0, z0, zn = (
        work[0],
        work[1],
        work[2],
        work[3],
        work[4],
        work[5],
        work[6],
        work[7],
    )
    drum0, zj0 = y[DRUM], y[ZJ]
    # Begin where the motion of the step before leads.
    for i in range(size):
        x[i] -= x0[i]
    for i in range(n):
        x0[i], z0[i] = nodes[0, i], states[0, i]
        x0[size - 1 - i], z0[size - 1 - i] = -nodes[1, i], -states[1, i]
    # The joint counts as a node whose displacement is that of the wire wound on the drum.
    x0[n] = radius * drum0
    for i in range(size):
        x[i] += x0[i]
    off_a = wire_in - y[CREEP_A1] - y[CREEP_A2] - crimp_slip(time, rig)
    off_b = -wire_in - y[CREEP_B1] - y[CREEP_B2]
    za_mean, zb_mean = y[ZA], y[ZB]
    position = 0.5 * (wire_in + x0[n])
    fa = sheath_factor(za_mean, y[SLIP_SPEED], y[SLID], position, y[AGE], drum0, other, time, rig)
    fb = sheath_factor(zb_mean, y[SLIP_SPEED], y[SLID], position, y[AGE], drum0, other, time, rig)
    distance = presliding_distance(rig.pretension, rig)
    drag = NODE_DRAG / n + rig.viscous / n
    count = n + 1
    # A share of the friction may act as in a lumped sheath, on the mean motion; it lags by a step.
    lumped = 0.5 * rig.capstan_exponent * rig.lumped_share
    in_nodes = 0.5 * rig.capstan_exponent * (1.0 - rig.lumped_share)
    end_a = math.exp(lumped * fa * y[LUMPED_A])
    end_b = math.exp(lumped * fb * y[LUMPED_B])
    tension_a = 0.0
    tension_b = 0.0
    for _ in range(NEWTON_STEPS):
        drum = x[n] / radius
        # Wire a: pulley, nodes 0..n-1, joint. Signed so that every residual is a force to the left.
        upper, upper_slope = _segment(off_a - x[0], count, time, rig)
        tension_a = upper
        for i in range(n):
            lower, lower_slope = _segment(x[i] - x[i + 1], count, time, rig)
            moved = x[i] - x0[i]
            z, dz = _dahl_after(z0[i], moved, distance)
            zn[i] = z
            phi = in_nodes * fa * shares[i]
            g = math.tanh(phi * z)
            dg = (1.0 - g * g) * phi * dz
            rest[i] = upper - lower - (upper + lower) * g - drag * moved / step
            low[i] = upper_slope * (1.0 - g) if i > 0 else 0.0
            mid[i] = (
                -upper_slope * (1.0 - g)
                - lower_slope * (1.0 + g)
                - (upper + lower) * dg
                - drag / step
            )
            high[i] = lower_slope * (1.0 + g)
            upper, upper_slope = lower, lower_slope
        at_joint_a, slope_a = upper / end_a, upper_slope / end_a
        # Wire b lies mirrored: displacement -x towards the motor.
        upper, upper_slope = _segment(off_b + x[size - 1], count, time, rig)
        tension_b = upper
        for k in range(n):
            i = size - 1 - k
            lower, lower_slope = _segment(x[i - 1] - x[i], count, time, rig)
            moved = -(x[i] - x0[i])
            z, dz = _dahl_after(-z0[i], moved, distance)
            zn[i] = -z
            phi = in_nodes * fb * shares[k]
            g = math.tanh(phi * z)
            dg = (1.0 - g * g) * phi * dz
            rest[i] = -(upper - lower - (upper + lower) * g - drag * moved / step)
            high[i] = upper_slope * (1.0 - g) if k > 0 else 0.0
            mid[i] = (
                -upper_slope * (1.0 - g)
                - lower_slope * (1.0 + g)
                - (upper + lower) * dg
                - drag / step
            )
            low[i] = lower_slope * (1.0 + g)
            upper, upper_slope = lower, lower_slope
        at_joint_b, slope_b = upper / end_b, upper_slope / end_b
        # Joint, as a force along the wire.
        resist = joint_resistance(drum, rig)
        zj, dzj = _dahl_after(zj0, drum - drum0, rig.joint_presliding)
        grip = joint_friction(drum, rig)
        load = joint_moment(drum, y[RELAXED], other, time, rig)
        load_slope = (joint_moment(drum + PROBE, y[RELAXED], other, time, rig) - load) / PROBE
        rate = (drum - drum0) / step
        moment = load - grip * zj - resist * rate - rig.inertia * (rate - y[RATE]) / step
        moment_slope = load_slope - grip * dzj - resist / step - rig.inertia / step**2
        rest[n] = at_joint_a - at_joint_b + moment / radius
        low[n] = slope_a
        mid[n] = -slope_a - slope_b + moment_slope / radius**2
        high[n] = slope_b
        largest = _solve_tridiagonal(low, mid, high, rest)
        for i in range(size):
            x[i] -= rest[i]
        if largest < TOLERANCE:
            break
    drum = x[n] / radius
    moved = 0.5 * (wire_in - y[WOUND] + radius * (drum - drum0))
    y[LUMPED_A], _unused = _dahl_after(y[LUMPED_A], moved, distance)
    y[LUMPED_B], _unused = _dahl_after(y[LUMPED_B], -moved, distance)
    y[WOUND] = wire_in
    za_mean, zb_mean = 0.0, 0.0
    for i in range(n):
        nodes[0, i], states[0, i] = x[i], zn[i]
        nodes[1, i], states[1, i] = -x[size - 1 - i], -zn[size - 1 - i]
        za_mean += shares[i] * states[0, i]
        zb_mean += shares[i] * states[1, i]
    zj, _unused = _dahl_after(zj0, drum - drum0, rig.joint_presliding)
    middle_a = wire_tension(off_a - x[n], time, rig)
    middle_b = wire_tension(off_b + x[n], time, rig)
    slip = 0.0
    for i in range(n):
        slip += shares[i] * (x[i] - x0[i]) / step
    rates = work[1]
    for i in range(SLID, STATES):
        rates[i] = 0.0
    for i in range(CREEP_A1, CREEP_B2 + 1):
        rates[i] = 0.0
    slow_rates(y, rates, middle_a, middle_b, slip, drum, rig)
    for i in range(CREEP_A1, STATES):
        y[i] += step * rates[i]
    y[RATE] = (drum - drum0) / step
    y[DRUM] = drum
    y[TIP] = drum
    y[ZA], y[ZB], y[ZJ] = za_mean, zb_mean, zj
    readings[0], readings[1] = tension_a * end_a, tension_b * end_b


@compiled
def _solve_tridiagonal(low: Any, mid: Any, high: Any, rest: Any) -> float:
    """Thomas algorithm; the solution replaces `rest`. Returns its largest absolute entry."""
    size = mid.size
    for i in range(1, size):
        factor = low[i] / mid[i - 1]
        mid[i] -= factor * high[i - 1]
        rest[i] -= factor * rest[i - 1]
    rest[size - 1] /= mid[size - 1]
    largest = abs(rest[size - 1])
    for i in range(size - 2, -1, -1):
        rest[i] = (rest[i] - high[i] * rest[i + 1]) / mid[i]
        largest = max(largest, abs(rest[i]))
    return float(largest)

"""Reference model of a joint pulled by wires in sheaths with distributed friction, slow and simple.

A wire is a row of springs joined at nodes. Each node rubs on the sheath with its share of the
capstan's exponent (Euler 1769, Eytelwein 1808), so the tensions on its two sides hold it as long as

    |ln T_i - ln T_(i+1)| <= dphi_i,

and where they do not, it slips just far enough that they do. Starting from a guess of the nodes
that slip, one node after the other is corrected, and all again until none moves. Fronts that travel
along the wire are a result, not an assumption.

A wire of `cells` nodes has its tensions at s = i / cells, i = 0 .. cells; the springs at its two
ends are half as long as the others, so the sums over the wire are trapezoidal rules and its two end
tensions are those of the first and the last spring, with the whole exponent between them.

The bending section is a row of hinges, bent alike. With section friction the wire on the inside of
the bend rubs on a guide at each of them (capstan; Kaneko et al., IEEE ICRA 1991), and the tension
that arrives acts on the hinge. `section_friction` is that of the whole section by its moment, mu in
r T (1 - mu |q - qs|) to first order, with r T the moment without friction: each of the three hinges
rubs with 1.5 mu per rad of its own bend, so that the tension falls by exp(-1.5 mu |q - qs|) up to
the last.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm

from endoscope_core.compiled import compiled
from endoscope_lab.concealed.sliding_wire import Plant, pull, wire_of

Array = NDArray[np.float64]

NOMINAL: Plant = {
    'pretension': 5.0,
    'pretension_profile': 0.75,
    'wire_stiffness': 3000.0,
    'pulley_radius': 0.0024,
    'joint_radius': 0.0008,
    'capstan_exponent': 0.9,
    'friction_profile': (),
    'joint_stiffness': 0.0045,
    'joint_rest_angle': 0.0,
    'joint_friction': 9.0e-4,
    'joint_presliding': 0.03,
    'joint_presliding_spread': 0.0,
    'section_friction': 0.0,
    'section_straight_angle': 0.0,
    'joint_damping': 1.0e-5,
    'motor_bandwidth': 30.0,
    'motor_damping_ratio': 0.9,
}

HINGES = 3
ANGLE_SETTLED = 1e-11  # rad
BALANCED = 1e-12  # N m


@dataclass(frozen=True)
class Acting:
    """Laws that act on wires and joint beyond `NOMINAL`."""

    rubbing: Array  # (N,), factor on the exponent of all nodes before each row
    moment: Array  # (N,), on the joint from outside before each row, N m
    # Moment -weight_nm sin(angle + weight_rad).
    weight_nm: float = 0.0
    weight_rad: float = 0.0
    # Contact of two round bodies beyond an angle on either side (Hertz 1882): its moment is
    # stop_stiffness (|angle| - stop_rad)^1.5, N m/rad^1.5.
    stop_rad: float = math.inf
    stop_stiffness: float = 0.0


def simulate(
    plant: Plant, shaft_command: ArrayLike, tick: float, cells: int
) -> tuple[Array, Array, Array, Array]:
    """Shaft (N,) in rad, tensions at motor and joint (N, 2) in N and bending angle (N,) in rad."""
    # Row k is the state before command k acts, which is held for one tick in s.
    shaft = motor_angle(plant, shaft_command, tick)
    return shaft, *follow(plant, shaft, tick, cells)


def motor_angle(plant: Plant, shaft_command: ArrayLike, tick: float) -> Array:
    """Angle in rad (N,) of a second-order servo before each command; exact for held commands."""
    bandwidth, damping = plant['motor_bandwidth'], plant['motor_damping_ratio']
    # The held command is a third state that does not change (Van Loan 1978).
    rate = [[0, 1, 0], [-(bandwidth**2), -2 * damping * bandwidth, bandwidth**2], [0, 0, 0]]
    transition = expm(np.array(rate, dtype=float) * tick)
    state, angle = np.zeros(3), []
    for command in np.asarray(shaft_command, dtype=float):
        angle.append(state[0])
        state[2] = command
        state = transition @ state
    return np.array(angle)


def follow(
    plant: Plant, shaft: ArrayLike, tick: float, cells: int, acting: Acting | None = None
) -> tuple[Array, Array, Array]:
    """`at_motor, at_joint, angle` as from `simulate`, for a known angle of the shaft."""
    spread = float(plant['joint_presliding_spread'])
    elements = np.exp(spread * np.array([-1.0, 0.0, 1.0])) if spread else np.ones(1)
    grip, springs, tension = wire_of(plant, cells)
    shaft = np.asarray(shaft, dtype=float)
    acting = acting or Acting(np.ones(len(shaft)), np.zeros(len(shaft)))
    load = (acting.weight_nm, acting.weight_rad, acting.stop_rad, acting.stop_stiffness)
    ends, angle = np.empty((2, len(shaft), 2)), np.empty(len(shaft))
    names = (
        'pulley_radius',
        'joint_radius',
        'joint_stiffness',
        'joint_rest_angle',
        'joint_friction',
        'joint_damping',
        'section_friction',
        'section_straight_angle',
    )
    settled = _follow(
        shaft - shaft[0],
        tick,
        np.array([plant[name] for name in names], dtype=float),
        float(plant['joint_presliding']) * elements,
        np.array(load),
        acting.rubbing,
        acting.moment,
        np.log(grip),
        grip,
        springs,
        np.stack([tension, tension]),
        np.empty((2, cells + 1)),
        np.zeros((2, cells + 2)),
        np.full(2, np.sum(tension / springs)),
        np.zeros(len(elements)),
        *ends,
        angle,
    )
    if not settled:
        raise RuntimeError('nodes of a wire did not settle')
    return ends[0], ends[1], angle


@compiled
def _imbalance(
    step: float,
    turn: float,
    angle: float,
    tick: float,
    p: Array,
    presliding: Array,
    load: Array,
    moment: float,
    grip: Array,
    springs: Array,
    before: Array,
    tension: Array,
    slip: Array,
    extension: Array,
    deflection: Array,
) -> float:
    """Unbalanced torque in N m after a joint step in rad; it rises with the step."""
    pulley, radius, stiffness, rest, friction, damping, rubs, straight = p
    left_over = damping * step / tick + stiffness * (angle + step - rest)
    left_over += load[0] * math.sin(angle + step + load[1]) - moment
    beyond = abs(angle + step) - load[2]
    if beyond > 0.0:
        left_over += math.copysign(load[3] * beyond**1.5, angle + step)
    for i in range(len(presliding)):
        left_over += friction * _rubbed(deflection[i], step, presliding[i]) / len(presliding)
    bend = angle + step - straight
    inner = 0 if bend >= 0.0 else 1
    # The motor's turn in rad and the step move both wires; NaN if a wire's nodes do not settle.
    for wire in range(2):
        sign = 1.0 - 2.0 * wire
        if not pull(
            extension[wire],
            sign * pulley * turn,
            sign * radius * step,
            before[wire],
            slip[wire],
            grip,
            springs,
            tension[wire],
        ):
            return math.nan
        pulled = tension[wire, -1]
        if rubs > 0.0 and wire == inner:
            pulled *= _left_at_hinges(rubs * bend, step, presliding, deflection)
        left_over -= sign * radius * pulled
    return left_over


@compiled
def _left_at_hinges(bent: float, step: float, presliding: Array, deflection: Array) -> float:
    """Mean over the hinges of the share of the inner wire's tension that arrives there.

    `bent` is mu (q - qs), with the sign of the bend, after a joint step in rad.
    """
    # Hinges in a row add their angles, each against n times the stiffness of them all. Hinge i
    # balances for itself what arrives there, r T_i against n K q_i, and the mean of all n balances
    # is that of one joint on which the mean of T_i acts. At each the tension falls by the capstan's
    # ratio. All are taken as bent alike, by (q - qs) / n; that T_i differ changes only O(a^2):
    #
    #     T_i = T_(i-1) exp(-a s_i),   mean T_i = T (1 - a sum_i (n + 1 - i) s_i / n) + O(a^2),
    #
    # s_i how far the wire's friction there has built up. Where all s_i are one, the sum over n is
    # (n + 1) / 2, so all of it is mu (q - qs) for a = 2 mu (q - qs) / (n + 1).
    #
    # A growing bend draws the inner wire towards the motor, and s_i has the sign of q - qs then:
    # less arrives at every hinge. A shrinking one lets it go, and more does. A hinge turns as its
    # wire slides, so s_i is the state of an element of the joint's friction. Of unlike elements the
    # first hinge has the one of the least angle: there the wire slides by what all hinges turn.
    #
    # At straight all ratios are one, whichever wire is the inner one: the imbalance has no jump. It
    # rises with the step but for what |q - qs| adds to a wire that is let go, by which it falls at
    # no more than r T mu exp(2 n / (n + 1) mu |q - qs|). Where that is more than stiffness and
    # damping have it rise, of a wire that is very taut, the joint snaps to less bend. There is a
    # root in any case: far out the wire that would bend the joint further is slack.
    own_bent = 2.0 / (HINGES + 1.0) * bent
    arriving, share = 1.0, 0.0
    for hinge in range(HINGES):
        i = min(hinge, len(presliding) - 1)
        arriving *= math.exp(-own_bent * _rubbed(deflection[i], step, presliding[i]))
        share += arriving / HINGES
    return share


@compiled
def _rubbed(deflection: float, step: float, presliding: float) -> float:
    """Dahl's friction (Dahl 1968) over its limit, after a step of one sign."""
    limit = math.copysign(1.0, step)
    return limit + (deflection - limit) * math.exp(-abs(step) / presliding)


@compiled
def _follow(
    shaft: Array,
    tick: float,
    p: Array,
    presliding: Array,
    load: Array,
    rubbing: Array,
    moment: Array,
    exponent: Array,
    grip: Array,
    springs: Array,
    before: Array,
    tension: Array,
    slip: Array,
    extension: Array,
    deflection: Array,
    at_motor: Array,
    at_joint: Array,
    angles: Array,
) -> bool:
    angle, step = 0.0, 0.0
    for k in range(len(shaft)):
        angles[k] = angle
        for wire in range(2):
            at_motor[k, wire], at_joint[k, wire] = before[wire, 0], before[wire, -1]
        if k + 1 == len(shaft):
            break
        turn = shaft[k + 1] - shaft[k]
        for j in range(len(grip)):
            grip[j] = math.exp(rubbing[k + 1] * exponent[j])
        wires = (
            p,
            presliding,
            load,
            moment[k + 1],
            grip,
            springs,
            before,
            tension,
            slip,
            extension,
            deflection,
        )
        # Brackets the step around the last one.
        width = max(0.1 * abs(step), 1e-6)
        low, high = step - width, step + width
        over = _imbalance(high, turn, angle, tick, *wires)
        while over < 0.0:
            high += width
            width *= 2.0
            over = _imbalance(high, turn, angle, tick, *wires)
        under = _imbalance(low, turn, angle, tick, *wires)
        while under > 0.0:
            low -= width
            width *= 2.0
            under = _imbalance(low, turn, angle, tick, *wires)
        # Regula falsi as of Illinois (Dowell and Jarratt 1971).
        side = 0
        while high - low > ANGLE_SETTLED:
            step = (low * over - high * under) / (over - under)
            left_over = _imbalance(step, turn, angle, tick, *wires)
            if abs(left_over) <= BALANCED:
                break
            if left_over > 0.0:
                high, over = step, left_over
                under *= 0.5 if side > 0 else 1.0
                side = 1
            elif left_over < 0.0:
                low, under = step, left_over
                over *= 0.5 if side < 0 else 1.0
                side = -1
            else:
                return False
        angle += step
        for wire in range(2):
            sign = 1.0 - 2.0 * wire
            extension[wire] += sign * (p[0] * turn - p[1] * step)
            for i in range(len(springs)):
                before[wire, i] = tension[wire, i]
        for i in range(len(presliding)):
            deflection[i] = _rubbed(deflection[i], step, presliding[i])
    return True

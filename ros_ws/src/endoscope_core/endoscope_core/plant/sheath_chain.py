"""Compiled physics of one wire whose friction acts on nodes along the sheath.

The nodes have no mass: their balance holds at the end of every substep, linearised about its
start. Elimination from the motor towards the joint leaves the last spring's tension as a linear
function of the joint's step; once the joint is solved, the nodes follow backwards.
"""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import dahl
from endoscope_core.effects.distributed_friction import (
    COUNT,
    GAIN,
    OFFSET,
    SHARE,
    SLIDE,
    STEP,
    STRETCH,
    WIRE_A,
    WIRE_B,
    length,
)
from endoscope_core.effects.slots import PRESLIDING_DISTANCE, WIRE_STIFFNESS
from endoscope_core.effects.wire_creep import CREEP_A, CREEP_B
from endoscope_core.plant.transmission import half_exponent, wire_tension

LEAST_STIFFNESS = 1e-3
"""Share of its stiffness that a slack spring keeps in the linearisation: it must be solvable."""
SWEEPS = 4
"""Most eliminations in a substep, until all nodes move the way that their friction was taken for: a
node that turns is gripped at once, though it slid freely before."""
AT_REST = 1e-12
"""Displacement in m below which the way of a node does not matter."""


@compiled
def spring_tension(
    state: Array,
    chain: int,
    p: Array,
    on: Flags,
    pretension: float,
    common: float,
    i: int,
) -> tuple[float, float]:
    """Tension and slope of spring `i`; `common` is stretch in m spread over the whole wire."""
    share = length(p, i)
    tension, slope = wire_tension(p, on, pretension, state[chain + STRETCH + i] / share + common)
    return tension, max(slope, LEAST_STIFFNESS * p[WIRE_STIFFNESS]) / share


@compiled
def _eliminate(
    state: Array,
    chain: int,
    p: Array,
    on: Flags,
    pretension: float,
    common: float,
    phi: float,
    motor_step: float,
) -> tuple[float, float]:
    """Tension in N at the joint after a substep if the joint stood still, and its slope in N/m.

    Parameters
    ----------
    chain : int
        First state of this wire's chain.
    phi : float
        Capstan exponent of the whole chain.
    motor_step : float
        By how much the motor pulls the wire in this substep, m.
    """
    nodes = int(p[COUNT])
    first, first_slope = spring_tension(state, chain, p, on, pretension, common, 0)
    offset, gain, before, slope_before = motor_step, 0.0, first, first_slope
    for _ in range(SWEEPS):
        offset, gain, before, slope_before = motor_step, 0.0, first, first_slope
        for i in range(nodes):
            after, slope_after = spring_tension(state, chain, p, on, pretension, common, i + 1)
            slide = state[chain + SLIDE + i]
            exponent, share = half_exponent(p, on, phi / nodes, slide, 0.0)
            released = math.exp(-exponent)
            pulled = 1.0 / released
            way = 1.0 if state[chain + STEP + i] > 0.0 else -1.0
            grip = share * (before * released + after * pulled)
            grip *= (1.0 - slide * way) / p[PRESLIDING_DISTANCE]
            towards = slope_before * released
            away = slope_after * pulled
            yielding = 1.0 / (towards * (1.0 - gain) + away + grip)
            offset = (before * released - after * pulled + towards * offset) * yielding
            gain = away * yielding
            state[chain + OFFSET + i] = offset
            state[chain + GAIN + i] = gain
            before, slope_before = after, slope_after
        if not _turns(state, chain, nodes):
            break
    return before + slope_before * offset, slope_before * (1.0 - gain)


@compiled
def _turns(state: Array, chain: int, nodes: int) -> bool:
    """Whether a node is about to move the other way than was assumed; now it is assumed to."""
    turning = False
    step = state[chain + STEP + nodes]
    for i in range(nodes - 1, -1, -1):
        step = state[chain + OFFSET + i] + state[chain + GAIN + i] * step
        if abs(step) > AT_REST and (step > 0.0) != (state[chain + STEP + i] > 0.0):
            state[chain + STEP + i] = step
            turning = True
    return turning


@compiled
def _follow(
    state: Array,
    chain: int,
    p: Array,
    shake: float,
    motor_step: float,
    joint_step: float,
) -> None:
    """Move the nodes, once the joint has let out `joint_step` m of wire towards the motor."""
    nodes = int(p[COUNT])
    step = joint_step
    state[chain + STEP + nodes] = joint_step
    for i in range(nodes - 1, -1, -1):
        beyond = step
        step = state[chain + OFFSET + i] + state[chain + GAIN + i] * beyond
        state[chain + STRETCH + i + 1] += step - beyond
        slide = chain + SLIDE + i
        state[slide] = dahl.slid(state[slide], step / p[PRESLIDING_DISTANCE], shake)
        state[chain + STEP + i] = step
    state[chain + STRETCH] += motor_step - step


@compiled
def distal_tensions(
    state: Array,
    p: Array,
    on: Flags,
    pretension: float,
    shift: float,
    phi: float,
    wire_step: float,
) -> tuple[float, float, float, float]:
    """Tensions in N of both wires at the joint in a substep, and their slopes in N/m.

    Parameters
    ----------
    state, p, on : array (states,), array (parameters,), array (flags,) of bool
    pretension : float
        N.
    shift : float
        Stretch in m of the positive wire that neither motor nor joint causes.
    phi : float
        Capstan exponent of the whole sheath.
    wire_step : float
        By how much the motor pulls the positive wire in this substep, m.
    """
    phi *= p[SHARE]
    ta, ka = _eliminate(state, WIRE_A, p, on, pretension, shift - state[CREEP_A], phi, wire_step)
    tb, kb = _eliminate(state, WIRE_B, p, on, pretension, -shift - state[CREEP_B], phi, -wire_step)
    # The chain is solved for the end of the substep, the joint for its middle.
    return ta, tb, 2.0 * ka, 2.0 * kb


@compiled
def follow(
    state: Array,
    p: Array,
    shake: float,
    wire_step: float,
    joint_step: float,
) -> None:
    """Move the nodes of both wires, once the joint has let out `joint_step` m of the positive."""
    _follow(state, WIRE_A, p, shake, wire_step, joint_step)
    _follow(state, WIRE_B, p, shake, -wire_step, -joint_step)

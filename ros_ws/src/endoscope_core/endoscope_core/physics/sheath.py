"""A wire in its sheath: capstan friction along the whole length, solved quasi-statically.

The wire's tension is kept at nodes, closest at both ends, where fronts begin. Where it slides
towards the motor, ``dT/dphi = -T`` (Kaneko et al., IEEE ICRA 1991; Palli, Melchiorri, IEEE ICRA
2006); where it slides towards the joint, ``dT/dphi = T``; where it is stuck, its tension stays as
it was. An end that moves sends a front into the wire, behind which the tension follows the end and
before which everything is as it was: return-point memory, as in Preisach's model (Mayergoyz,
Mathematical Models of Hysteresis, 1991, ch. I). The stretch is the integral of the tension by the
trapezoidal rule, so that the tension at a moving end is a continuous function of its motion.

Behind a front the tension is an amplitude times one of two shapes, ``exp(-phi)`` and ``exp(phi)``.
So a wire is two regions, one from each end, and the nodes between them; a motion that goes on costs
only the nodes that its front passes. The symbols are those of the plant's equations; a displacement
w of an end, or a change of length, is given as ``kw``, the stiffness of the whole wire times it, N.
"""

import math

from endoscope_core.compiled import Array, compiled

MOTOR_END, JOINT_END = 0, 1

# A wire's numbers within the state array, from its first index on.
COUNT, SHAPE, AMPLITUDE, GAP = 0, 2, 4, 6
NODES = 8
"""First node; before it, for each end: nodes behind its front, their shape and amplitude, and the
slack at that end in N of stretch."""
TOWARDS_MOTOR, TOWARDS_JOINT = 0, 1
"""Shapes of a sliding wire's tension."""

FALLING, RISING, FALLING_SUM, RISING_SUM, FALLING_REST, RISING_REST, WEIGHT = range(7)
TABLE_ROWS = 7
"""Rows of a table of shapes, array (TABLE_ROWS, nodes)."""


def wire_states(cells: int) -> int:
    """Number of states of a wire of `cells` cells."""
    return NODES + cells + 1


@compiled
def tabulate(table: Array, places: Array, exponents: Array, falling: float, rising: float) -> None:
    """Work out the shapes of a sliding wire's tension, into `table` (TABLE_ROWS, N + 1).

    `places` (N + 1,) of the nodes along the wire go from 0 at the motor to 1 at the joint, the
    nominal capstan `exponents` (N + 1,) from the motor to each; `falling` and `rising` are factors
    on them where the wire slides towards the motor, and towards the joint.
    """
    nodes = table.shape[1]
    fallen, risen = 0.0, 0.0
    for i in range(nodes):
        weight = 0.5 * (places[min(i + 1, nodes - 1)] - places[max(i - 1, 0)])
        table[FALLING, i] = math.exp(-falling * exponents[i])
        if rising == falling:
            table[RISING, i] = 1.0 / table[FALLING, i]
        else:
            table[RISING, i] = math.exp(rising * exponents[i])
        fallen += weight * table[FALLING, i]
        risen += weight * table[RISING, i]
        table[FALLING_SUM, i] = fallen
        table[RISING_SUM, i] = risen
        table[WEIGHT, i] = weight
    fallen, risen = 0.0, 0.0
    # From each node to the joint: a difference of the sums from the motor on would be lost in
    # rounding where friction is great.
    for i in range(nodes - 1, -1, -1):
        fallen += table[WEIGHT, i] * table[FALLING, i]
        risen += table[WEIGHT, i] * table[RISING, i]
        table[FALLING_REST, i] = fallen
        table[RISING_REST, i] = risen


@compiled
def _weight_behind(table: Array, shape: int, end: int, count: int) -> float:
    """Sum of the weighted shape over the `count` nodes next to an end."""
    if end == MOTOR_END:
        return table[FALLING_SUM + shape, count - 1]
    return table[FALLING_REST + shape, table.shape[1] - count]


@compiled
def node_tension(x: Array, wire: int, table: Array, i: int) -> float:
    """Tension in N of node `i` of the wire whose states begin at `wire`."""
    if i < x[wire + COUNT]:
        return x[wire + AMPLITUDE] * table[int(x[wire + SHAPE]), i]
    if i >= table.shape[1] - x[wire + COUNT + JOINT_END]:
        return x[wire + AMPLITUDE + JOINT_END] * table[int(x[wire + SHAPE + JOINT_END]), i]
    return x[wire + NODES + i]


@compiled
def _shape(end: int, kw: float) -> int:
    """Shape behind the front of an end that is pulled (positive kw) or let go."""
    return TOWARDS_MOTOR if (end == MOTOR_END) == (kw > 0.0) else TOWARDS_JOINT


@compiled
def moved(
    x: Array, wire: int, table: Array, end: int, kw: float, floor: float
) -> tuple[float, float, int, float, float, float]:
    """What moving one end by `kw` N, positive out of the sheath, would do to a wire in `x`.

    Returns its tension at that end in N and the slope of that by `kw`; count of nodes behind the
    front and amplitude there in N; slack left at this and at the other end in N. No node's
    tension can be less than `floor` N: zero, or what load-independent friction adds.
    """
    nodes = table.shape[1]
    own = x[wire + GAP + end]
    other = x[wire + GAP + 1 - end]
    first = 0 if end == MOTOR_END else nodes - 1
    gap = 0.0
    if kw > 0.0:
        gap = max(0.0, own - kw)
        kw = max(0.0, kw - own)
    elif own > 0.0:
        gap = own - kw
        kw = 0.0
    if kw == 0.0:
        # Only slack has moved, or nothing.
        slope = 0.0 if gap > 0.0 else 1.0 / table[WEIGHT, first]
        return node_tension(x, wire, table, first), slope, 0, 0.0, gap, other

    shape = _shape(end, kw)
    count = int(x[wire + COUNT + end])
    if count > 0 and int(x[wire + SHAPE + end]) == shape:
        load = x[wire + AMPLITUDE + end] * _weight_behind(table, shape, end, count)
    elif int(x[wire + COUNT + 1 - end]) == nodes and int(x[wire + SHAPE + 1 - end]) == shape:
        # The other end's front has passed the whole wire, which slides the way that this end moves.
        count = nodes
        load = x[wire + AMPLITUDE + 1 - end] * _weight_behind(table, shape, end, count)
    else:
        count = 1
        load = table[WEIGHT, first] * node_tension(x, wire, table, first)
    load += kw
    weight = _weight_behind(table, shape, end, count)
    while count < nodes:
        i = count if end == MOTOR_END else nodes - 1 - count
        ahead = node_tension(x, wire, table, i)
        behind = load / weight * table[shape, i]
        if (behind <= ahead) if kw > 0.0 else (behind >= ahead):
            break
        load += table[WEIGHT, i] * ahead
        count += 1
        weight = _weight_behind(table, shape, end, count)
    amplitude = load / weight
    slope = table[shape, first] / weight
    if kw < 0.0:
        least = floor / table[shape, first]
        if amplitude < least:
            gap = (least - amplitude) * weight
            amplitude, slope = least, 0.0
    elif count == nodes and other > 0.0:
        # The other end hangs loose, so that the wire slides through the sheath.
        most = floor / table[shape, nodes - 1 - first]
        if amplitude > most:
            taken = min(other, (amplitude - most) * weight)
            amplitude -= taken / weight
            other -= taken
            if other > 0.0:
                slope = 0.0
    return amplitude * table[shape, first], slope, count, amplitude, gap, other


@compiled
def move(x: Array, wire: int, table: Array, end: int, kw: float, floor: float) -> None:
    """Move one end of a wire by `kw` N; see `moved`."""
    nodes = table.shape[1]
    _, _, count, amplitude, gap, other_gap = moved(x, wire, table, end, kw, floor)
    x[wire + GAP + end] = gap
    x[wire + GAP + 1 - end] = other_gap
    if count == 0:
        return
    other = 1 - end
    shape = _shape(end, kw)
    had, had_shape = int(x[wire + COUNT + end]), int(x[wire + SHAPE + end])
    if had == nodes and had_shape != shape:
        # A reversal: what slid as a whole now stands before the new front.
        x[wire + COUNT + other] = nodes
        x[wire + SHAPE + other] = had_shape
        x[wire + AMPLITUDE + other] = x[wire + AMPLITUDE + end]
    elif had_shape != shape:
        for k in range(count, had):
            i = k if end == MOTOR_END else nodes - 1 - k
            x[wire + NODES + i] = x[wire + AMPLITUDE + end] * table[had_shape, i]
    x[wire + COUNT + end] = count
    x[wire + SHAPE + end] = shape
    x[wire + AMPLITUDE + end] = amplitude
    x[wire + COUNT + other] = min(x[wire + COUNT + other], float(nodes - count))


@compiled
def mean_tension(x: Array, wire: int, table: Array) -> float:
    """Mean tension of a wire in N: its stiffness times its stretch."""
    mean = 0.0
    for end in range(2):
        count = int(x[wire + COUNT + end])
        if count > 0:
            shape = int(x[wire + SHAPE + end])
            mean += x[wire + AMPLITUDE + end] * _weight_behind(table, shape, end, count)
    stuck = table.shape[1] - int(x[wire + COUNT + JOINT_END])
    for i in range(int(x[wire + COUNT]), stuck):
        mean += table[WEIGHT, i] * x[wire + NODES + i]
    return mean


@compiled
def lengthen(x: Array, wire: int, table: Array, kw: float, floor: float) -> None:
    """Let a wire that is held at both ends grow longer by `kw` N.

    It grows in proportion to its tension everywhere, as what creeps under load does: nothing slips.
    What a slack wire grows is slack at the motor; what shrinks there is pulled in.
    """
    had = mean_tension(x, wire, table) - floor
    left = had - kw
    if had <= 0.0 or left > 10.0 * had:
        move(x, wire, table, MOTOR_END, -kw, floor)
        return
    spread(x, wire, table)
    for i in range(table.shape[1]):
        node = wire + NODES + i
        x[node] = floor + max(0.0, left / had) * (x[node] - floor)
    if left < 0.0:
        x[wire + GAP] -= left


@compiled
def spread(x: Array, wire: int, table: Array) -> None:
    """Write every node's tension into the state, as needed before the shapes change."""
    nodes = table.shape[1]
    for i in range(nodes):
        x[wire + NODES + i] = node_tension(x, wire, table, i)
    x[wire + COUNT] = x[wire + COUNT + JOINT_END] = 0.0


@compiled
def sliding_load(x: Array, wire: int, table: Array) -> float:
    """Mean tension in N of a wire that slides as a whole; 0 for any other."""
    for end in range(2):
        if int(x[wire + COUNT + end]) == table.shape[1]:
            shape = int(x[wire + SHAPE + end])
            return x[wire + AMPLITUDE + end] * table[FALLING_REST + shape, 0]
    return 0.0


@compiled
def slide_on(x: Array, wire: int, table: Array, load: float) -> None:
    """Take less steep shapes for a wire that all slips, with the same mean tension: see `relax`."""
    for end in range(2):
        if int(x[wire + COUNT + end]) == table.shape[1]:
            shape = int(x[wire + SHAPE + end])
            x[wire + AMPLITUDE + end] = load / table[FALLING_REST + shape, 0]


@compiled
def relax(x: Array, wire: int, table: Array, work: Array) -> None:
    """Let a spread wire slip where its tension is steeper than friction can now hold.

    A stretch that slips keeps its extension and ends on the limit; a stretch next to it that is
    then too steep slips with it. That is the pooling of adjacent violators (Barlow et al.,
    Statistical Inference under Order Restrictions, 1972, sec. 1.2) of tension over shape, once for
    each way. `table` has the new shapes; `work` (3, N + 1) is overwritten.
    """
    nodes = table.shape[1]
    for shape in range(2):
        sign = 1.0 if shape == TOWARDS_MOTOR else -1.0
        blocks = 0
        for i in range(nodes):
            load = table[WEIGHT, i] * x[wire + NODES + i]
            weight = table[WEIGHT, i] * table[shape, i]
            size = 1.0
            # Tension over the falling shape may only grow along the wire, over the rising fall.
            while blocks > 0 and sign * (
                work[0, blocks - 1] * weight - load * work[1, blocks - 1]
            ) > 1e-12 * abs(load * work[1, blocks - 1]):
                blocks -= 1
                load += work[0, blocks]
                weight += work[1, blocks]
                size += work[2, blocks]
            work[0, blocks], work[1, blocks], work[2, blocks] = load, weight, size
            blocks += 1
        i = 0
        for b in range(blocks):
            size = int(work[2, b])
            if size > 1:
                for j in range(i, i + size):
                    x[wire + NODES + j] = work[0, b] / work[1, b] * table[shape, j]
            i += size

"""The bending joint: overdamped, with friction that builds up over an angle.

``c q' = r (Ta - Tb) - K (q - q0) - tau_f z``, implicit in the angle at the end of a tick. Friction
is Dahl's (Aerospace Corp. TOR-0158(3107-18)-1, 1968), exact for a step of one sign.
"""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics import hooks
from endoscope_core.physics.folds import acting, folded, some_of, sum_of
from endoscope_core.physics.functions.acting import functions_act
from endoscope_core.physics.layout import (
    ELEMENTS,
    END_WAY,
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
    SLIDING_SPEED,
    WIRE_A,
    WIRE_B,
    WIRE_STIFFNESS,
)
from endoscope_core.physics.sheath import JOINT_END, mean_tension, move, moved

load = folded(hooks.LOAD)
film_drag = folded(hooks.FILM_DRAG)
end_length = folded(hooks.END_LENGTH)
stiffness_factor, stiffness_varies = folded(hooks.STIFFNESS), acting(hooks.STIFFNESS)
load_functions = sum_of(hooks.LOAD)
film_functions = sum_of(hooks.FILM_DRAG)
end_functions = sum_of(hooks.END_LENGTH)
stiffness_functions, stiffness_has_some = sum_of(hooks.STIFFNESS), some_of(hooks.STIFFNESS)
friction_functions = sum_of(hooks.JOINT_FRICTION)

_TRIES = 100
_PRECISION = 1e-11
_FIRST_STEP = 1e-14
"""Rad: tells only which way the joint turns."""


@compiled
def stiffness_on_the_way(
    x: Array, wire: int, table: Array, p: Array, on: Flags, way: float
) -> float:
    """Stiffness in N/m of a wire that is about to be stretched by `way` m, in the middle of that.

    At its beginning it would be too small on every way out and too large on every way back, and
    tension would leak away with every cycle.
    """
    stiffness = p[WIRE_STIFFNESS]
    if functions_act(on) and stiffness_has_some(on):
        return _stiffness_of_functions(x, wire, table, p, on, way)
    if not stiffness_varies(on):
        return stiffness
    tension = mean_tension(x, wire, table) - x[FLOOR]
    middle = tension + 0.5 * way * stiffness * stiffness_factor(on, p, x, tension)
    return stiffness * stiffness_factor(on, p, x, max(0.0, middle))


@compiled
def _stiffness_of_functions(
    x: Array, wire: int, table: Array, p: Array, on: Flags, way: float
) -> float:
    stiffness = p[WIRE_STIFFNESS]
    middle = tension = mean_tension(x, wire, table) - x[FLOOR]
    factor = 1.0
    for _ in range(2):
        factor = stiffness_factor(on, p, x, middle) * stiffness_functions(on, p, x, middle)
        middle = max(0.0, tension + 0.5 * way * stiffness * factor)
    return stiffness * factor


@compiled
def _slide(slide: float, step: float, presliding: float) -> tuple[float, float]:
    """Dahl state after a step, and its slope by the step."""
    way = 1.0 if step >= 0.0 else -1.0
    left = math.exp(-abs(step) / presliding)
    return way + (slide - way) * left, (1.0 - way * slide) * left / presliding


@compiled
def _presliding(p: Array, element: int) -> float:
    """Pre-sliding angle of one of the elements in rad."""
    return p[JOINT_PRESLIDING] * math.exp((element - 1) * p[JOINT_PRESLIDING_SPREAD])


@compiled
def _friction(x: Array, p: Array, most: float, step: float) -> tuple[float, float]:
    """Friction in N m against a step of the joint, of `most` N m at most, and its slope."""
    if p[JOINT_PRESLIDING_SPREAD] == 0.0:
        slide, slope = _slide(x[JOINT_SLIDE], step, p[JOINT_PRESLIDING])
        return most * slide, most * slope
    total, steep = 0.0, 0.0
    for i in range(ELEMENTS):
        slide, slope = _slide(x[JOINT_SLIDE + i], step, _presliding(p, i))
        total += slide
        steep += slope
    return most * total / ELEMENTS, most * steep / ELEMENTS


@compiled
def _imbalance(
    x: Array,
    table: Array,
    p: Array,
    on: Flags,
    step: float,
    stiff_a: float,
    stiff_b: float,
    film: float,
    most: float,
    way: float,
    other: float,
    time: float,
    tick: float,
) -> tuple[float, float]:
    """What is missing in N m to bend by `step`, and its slope."""
    r = p[JOINT_RADIUS]
    angle = x[JOINT] + step
    ta, sa, _, _, _, _ = moved(x, WIRE_A, table, JOINT_END, -stiff_a * r * step, x[FLOOR])
    tb, sb, _, _, _, _ = moved(x, WIRE_B, table, JOINT_END, stiff_b * r * step, x[FLOOR])
    moment, slope = load(on, p, x, angle, step, other, time, tick)
    if functions_act(on):
        added, steep = load_functions(on, p, x, angle, step, other, time, tick)
        moment += added
        slope += steep
    friction, steep = _friction(x, p, most, step)
    damping = (p[JOINT_DAMPING] + 0.5 * r * r * film) / tick
    moment += r * (ta - tb) - 0.5 * r * film * way / tick
    moment -= p[JOINT_STIFFNESS] * (angle - p[JOINT_REST_ANGLE]) + friction + damping * step
    slope += r * r * (stiff_a * sa + stiff_b * sb) + p[JOINT_STIFFNESS] + steep + damping
    return -moment, slope


@compiled
def _step(
    x: Array,
    table: Array,
    p: Array,
    on: Flags,
    stiff_a: float,
    stiff_b: float,
    film: float,
    most: float,
    way: float,
    other: float,
    time: float,
    tick: float,
) -> float:
    """By how much the joint bends, rad: Newton's method within a bracket.

    The nominal imbalance grows with the step and is concave on either side of zero, where fronts
    and pre-sliding soften it: from the last step Newton's method comes to the root from one side.
    """
    missing, slope = _imbalance(
        x, table, p, on, 0.0, stiff_a, stiff_b, film, most, way, other, time, tick
    )
    if missing == 0.0:
        return 0.0
    side = -1.0 if missing > 0.0 else 1.0
    near, far = 0.0, math.inf
    step = x[JOINT_STEP] if x[JOINT_STEP] * side > 0.0 else side * _FIRST_STEP
    for _ in range(_TRIES):
        missing, slope = _imbalance(
            x, table, p, on, step, stiff_a, stiff_b, film, most, way, other, time, tick
        )
        if missing * side <= 0.0:
            near = abs(step)
        else:
            far = abs(step)
        following = step - missing / slope if slope > 0.0 else math.nan
        if not near <= side * following <= far:
            following = side * (2.0 * near if math.isinf(far) else 0.5 * (near + far))
        if abs(following - step) <= _PRECISION:
            return following
        step = following
    return step


@compiled
def bend(
    x: Array,
    table: Array,
    p: Array,
    on: Flags,
    way: float,
    other: float,
    time: float,
    tick: float,
) -> None:
    """Bend the joint to where it comes to rest at the end of a tick of length `tick` s.

    `way`: by how much the pulley has wound up the positive wire in this tick, m. `other`: the other
    joint's angle, rad. `time`: the middle of the tick, s. Only `x` is changed.
    """
    # The way at the joint is not known yet: it will be much like the last one.
    ahead = p[JOINT_RADIUS] * x[JOINT_STEP]
    stiff_a = stiffness_on_the_way(x, WIRE_A, table, p, on, -ahead)
    stiff_b = stiffness_on_the_way(x, WIRE_B, table, p, on, ahead)
    shift = end_length(on, p, x, other)
    if functions_act(on):
        shift += end_functions(on, p, x, other)
    if shift != x[END_WAY]:
        move(x, WIRE_A, table, JOINT_END, stiff_a * (shift - x[END_WAY]), x[FLOOR])
        move(x, WIRE_B, table, JOINT_END, stiff_b * (x[END_WAY] - shift), x[FLOOR])
        x[END_WAY] = shift
    film = film_drag(on, p, x, abs(x[SLIDING_SPEED]))
    most = p[JOINT_FRICTION]
    if functions_act(on):
        film += film_functions(on, p, x, abs(x[SLIDING_SPEED]))
        most *= friction_functions(on, p, x)
    step = _step(x, table, p, on, stiff_a, stiff_b, film, most, way, other, time, tick)
    r = p[JOINT_RADIUS]
    if step != 0.0:
        move(x, WIRE_A, table, JOINT_END, -stiff_a * r * step, x[FLOOR])
        move(x, WIRE_B, table, JOINT_END, stiff_b * r * step, x[FLOOR])
        for i in range(ELEMENTS):
            x[JOINT_SLIDE + i], _ = _slide(x[JOINT_SLIDE + i], step, _presliding(p, i))
    x[SLIDING_SPEED] = 0.5 * (way + r * step) / tick
    x[FILM] = film * x[SLIDING_SPEED]
    x[FILM + 1] = -x[FILM]
    x[JOINT] += step
    x[JOINT_STEP] = step

"""One bending joint, tick by tick: servo, pair of wires in their sheaths, joint, readings.

No effect is named here: what can be added to the nominal plant acts through the hooks. The symbols
are those of the plant's equations: displacements w(0) and w(Phi) of a wire at the motor and at the
joint, its tension T, the capstan exponent phi from the motor to a place, Phi of the whole sheath.
"""

import math

import numpy as np

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics import hooks
from endoscope_core.physics.folds import acting, folded, follow
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.places import LAG
from endoscope_core.physics.joint import bend, secant_stiffness
from endoscope_core.physics.layout import (
    ANGLE_HISTORY,
    CAPSTAN_EXPONENT,
    CELLS,
    COMMAND_HISTORY,
    EXPONENTS,
    EXTRA_LENGTH,
    FALLING_FACTOR,
    FILM,
    FLOOR,
    FRICTION_PROFILE,
    HISTORY,
    IN_COMMAND,
    IN_OTHER_JOINT,
    JOINT,
    JOINT_STEP,
    LAGGED_ANGLE,
    LAGGED_LOAD,
    LAGGED_SPEED,
    MEAN_TENSION,
    MOTOR,
    MOTOR_BANDWIDTH,
    MOTOR_DAMPING_RATIO,
    MOTOR_SPEED,
    NOW,
    OTHER,
    OUT_BENDING,
    OUT_EFFORT,
    OUT_JOINT,
    OUT_MOTOR,
    OUT_MOTOR_SPEED,
    OUT_TENSION_A,
    OUT_TENSION_B,
    PATH,
    PLACES,
    PRETENSION,
    PRETENSION_PROFILE,
    PROFILE_TERMS,
    PULLEY,
    PULLEY_RADIUS,
    REST_TENSION,
    RISING_FACTOR,
    SLIDING_SPEED,
    SLOTS,
    TENSION_DIFFERENCE,
    TENSION_HISTORY,
    TICKS,
    TIP,
    TRANSITION,
    TRAVEL,
    WINDING_SPEED,
    WIRE_A,
    WIRE_B,
    WORK,
)
from endoscope_core.physics.servo import transition, turn_motor
from endoscope_core.physics.sheath import (
    MOTOR_END,
    NODES,
    TABLE_ROWS,
    lengthen,
    mean_tension,
    move,
    node_tension,
    relax,
    slide_on,
    sliding_load,
    spread,
    tabulate,
)

pulley_angle = folded(hooks.PULLEY_ANGLE)
travel_of = folded(hooks.TRAVEL_OF)
exponent_factor, exponent_varies = folded(hooks.EXPONENT), acting(hooks.EXPONENT)
direction_factors = folded(hooks.DIRECTION)
friction_floor = folded(hooks.FRICTION_FLOOR)
added_length, length_varies = folded(hooks.LENGTH), acting(hooks.LENGTH)
tip_angle = folded(hooks.TIP_ANGLE)
effort_reading = folded(hooks.EFFORT)
tracker_reading = folded(hooks.TRACKER)
cell_input = folded(hooks.CELL_INPUT)
load_cell_reading = folded(hooks.LOAD_CELL)
advance, something_follows = folded(hooks.ADVANCE), acting(hooks.ADVANCE)
functions_follow = follow()
_LENGTH_LAGS, _EXPONENT_LAGS, _LOAD_LAGS = (
    (FUNCTIONS[name].flag, FUNCTIONS[name].first_parameter + LAG)
    for name in (
        'length_of_lagging_tension',
        'exponent_of_lagging_speed',
        'load_of_relaxing_angle',
    )
)
"""Flag of each function whose argument lags, and where its time constant stands."""

_SHAFT_ANGLES = np.array(SLOTS.shaft_angles)
_STEPS_TO_START = 64
_SETTLING_TICK = 1.0
_SAME_FACTOR = 1e-12


@compiled
def settle(
    x: Array, history: Array, sheath: Array, p: Array, on: Flags, shaft: float, tick: float
) -> None:
    """Bring a joint to rest, its wires tightened at angle zero and the motor gone to `shaft` since.

    `shaft` in rad. Fills `x` (states,), `history` (HISTORIES, HISTORY) and `sheath`
    (SHEATH_ROWS, CELLS + 1) from `p` (parameters,) and `on` (flags,), for ticks of `tick` s.
    """
    x[:] = 0.0
    a11, a12, a21, a22 = transition(p[MOTOR_BANDWIDTH], p[MOTOR_DAMPING_RATIO], tick)
    x[TRANSITION], x[TRANSITION + 1], x[TRANSITION + 2], x[TRANSITION + 3] = a11, a12, a21, a22
    _lay_out(sheath, p)
    # Load-independent friction f0 per unit length: the same law for T + f0 / mu'.
    x[FLOOR] = friction_floor(on, p, x)
    # A function of the mean tension may act on the exponent, which has to be known before the
    # tension is.
    x[MEAN_TENSION] = p[PRETENSION]
    _shape(x, sheath, p, on, exponent_factor(on, p, x, 0.0, -0.5 * tick, tick))
    table = sheath[:TABLE_ROWS]
    for wire in (WIRE_A, WIRE_B):
        for i in range(CELLS + 1):
            # T(phi) = T0 exp(-tight phi)
            start = p[PRETENSION] * math.exp(-p[PRETENSION_PROFILE] * sheath[EXPONENTS, i])
            x[wire + NODES + i] = start + x[FLOOR]
        relax(x, wire, table, sheath[WORK : WORK + 3])
    x[REST_TENSION] = mean_tension(x, WIRE_A, table) - x[FLOOR]
    x[LAGGED_LOAD] = x[LAGGED_LOAD + 1] = x[REST_TENSION]
    turn_to(x, history, sheath, p, on, shaft)


@compiled
def turn_to(x: Array, history: Array, sheath: Array, p: Array, on: Flags, shaft: float) -> None:
    """Turn the motor of a joint at rest to `shaft`, so slowly that nothing but friction remembers.

    `shaft` in rad; `x`, `history` and `sheath` are as `settle` leaves them, and changed.
    """
    table = sheath[:TABLE_ROWS]
    begin = x[MOTOR]
    for i in _SHAFT_ANGLES:
        x[i] = shaft
    history[COMMAND_HISTORY, :] = shaft
    steps = _STEPS_TO_START if shaft != begin else 1
    for k in range(1, steps + 1):
        if length_varies(on):
            _grow(x, table, p, on, 0.0)
        x[MOTOR] = begin + (shaft - begin) * k / steps
        _wind_up(x, table, p, on, x[MOTOR])
        bend(x, table, p, on, 0.0, 0.0, -0.5 * _SETTLING_TICK, _SETTLING_TICK)
        if functions_follow(on):
            _keep_up(x, table, p, on, 0.0)
    for wire in range(2):
        x[FILM + wire] = 0.0
    x[SLIDING_SPEED] = x[JOINT_STEP] = 0.0
    x[TIP] = x[JOINT]
    history[ANGLE_HISTORY, :] = x[TIP]
    t_a, t_b = tensions(x, sheath, MOTOR_END)
    history[TENSION_HISTORY, :], history[TENSION_HISTORY + 1, :] = t_a, t_b


@compiled
def _keep_up(x: Array, table: Array, p: Array, on: Flags, tick: float) -> None:
    """Let the states follow that only functions depend on; a tick of zero settles them."""
    load_a = mean_tension(x, WIRE_A, table) - x[FLOOR]
    load_b = mean_tension(x, WIRE_B, table) - x[FLOOR]
    # Read by functions at places of the tension alone (`both_tensions`): the nominal physics has
    # each wire's own tension, node by node.
    x[MEAN_TENSION] = 0.5 * (load_a + load_b)
    x[TENSION_DIFFERENCE] = load_a - load_b
    x[PATH] += abs(x[SLIDING_SPEED]) * tick
    # A first-order lag with its input held: y <- y + (1 - exp(-tick / lag)) (u - y).
    if on[_LENGTH_LAGS[0]]:
        share = _settled_share(tick, p[_LENGTH_LAGS[1]])
        x[LAGGED_LOAD] += share * (load_a - x[LAGGED_LOAD])
        x[LAGGED_LOAD + 1] += share * (load_b - x[LAGGED_LOAD + 1])
    if on[_EXPONENT_LAGS[0]]:
        share = _settled_share(tick, p[_EXPONENT_LAGS[1]])
        x[LAGGED_SPEED] += share * (abs(x[SLIDING_SPEED]) - x[LAGGED_SPEED])
    if on[_LOAD_LAGS[0]]:
        share = _settled_share(tick, p[_LOAD_LAGS[1]])
        x[LAGGED_ANGLE] += share * (x[JOINT] - x[LAGGED_ANGLE])


@compiled
def _settled_share(tick: float, lag: float) -> float:
    return -math.expm1(-tick / lag) if tick > 0.0 else 1.0


@compiled
def _lay_out(sheath: Array, p: Array) -> None:
    """Places of the nodes along the wire, and the capstan exponent from the motor to each."""
    # Clenshaw and Curtis (Numer. Math. 2, 1960): closest at the ends.
    total = 0.0
    for i in range(CELLS + 1):
        sheath[PLACES, i] = 0.5 - 0.5 * math.cos(math.pi * i / CELLS)
        if i > 0:
            before, after = sheath[PLACES, i - 1], sheath[PLACES, i]
            middle = _curvature(p, 0.5 * (before + after))
            ends = _curvature(p, before) + _curvature(p, after)
            total += (after - before) * (ends + 4.0 * middle) / 6.0
        sheath[EXPONENTS, i] = total
    for i in range(CELLS + 1):
        sheath[EXPONENTS, i] *= p[CAPSTAN_EXPONENT] / total


@compiled
def _curvature(p: Array, place: float) -> float:
    """Share of the capstan exponent at a place, to a factor."""
    # exp(sum of c_j cos(j pi s)), s from 0 at the motor to 1 at the joint
    total = 0.0
    for j in range(PROFILE_TERMS):
        if p[FRICTION_PROFILE + j] != 0.0:
            total += p[FRICTION_PROFILE + j] * math.cos((j + 1) * math.pi * place)
    return math.exp(total)


@compiled
def _shape(x: Array, sheath: Array, p: Array, on: Flags, factor: float) -> None:
    """Work out the table of shapes for a factor on the capstan exponent."""
    falling, rising = direction_factors(on, p, x)
    x[FALLING_FACTOR], x[RISING_FACTOR] = factor * falling, factor * rising
    table = sheath[:TABLE_ROWS]
    tabulate(table, sheath[PLACES], sheath[EXPONENTS], x[FALLING_FACTOR], x[RISING_FACTOR])


@compiled
def _change_friction(
    x: Array, sheath: Array, p: Array, on: Flags, speed: float, time: float, tick: float
) -> None:
    """Go over to the friction of this tick; where it holds less than before, the wires slip."""
    falling, _ = direction_factors(on, p, x)
    factor = exponent_factor(on, p, x, speed, time, tick)
    before = x[FALLING_FACTOR] / falling
    if abs(factor - before) <= _SAME_FACTOR * before:
        return
    table = sheath[:TABLE_ROWS]
    slips = factor < before
    load_a = sliding_load(x, WIRE_A, table) if slips else 0.0
    load_b = sliding_load(x, WIRE_B, table) if slips else 0.0
    for wire, load in ((WIRE_A, load_a), (WIRE_B, load_b)):
        if load == 0.0:
            spread(x, wire, table)
    _shape(x, sheath, p, on, factor)
    for wire, load in ((WIRE_A, load_a), (WIRE_B, load_b)):
        if load > 0.0:
            slide_on(x, wire, table, load)
        elif slips:
            relax(x, wire, table, sheath[WORK : WORK + 3])


@compiled
def _grow(x: Array, table: Array, p: Array, on: Flags, time: float) -> None:
    """Give both wires the length that effects have added to them by `time`."""
    for k in range(2):
        wire = WIRE_A if k == 0 else WIRE_B
        length = added_length(on, p, x, k, time)
        grown = length - x[EXTRA_LENGTH + k]
        if grown != 0.0:
            kw = secant_stiffness(x, wire, table, p, on, -grown) * grown
            lengthen(x, wire, table, kw, x[FLOOR])
            x[EXTRA_LENGTH + k] = length


@compiled
def _wind_up(x: Array, table: Array, p: Array, on: Flags, m: float) -> float:
    """Turn the shaft to `m` rad; returns by how much the positive wire has moved, m."""
    # w(0) = +-pulley_radius m
    x[PULLEY] = pulley_angle(on, p, x, m)
    wound = p[PULLEY_RADIUS] * x[PULLEY]
    w_a, w_b = travel_of(on, p, x, wound, 0), travel_of(on, p, x, -wound, 1)
    for k in range(2):
        wire = WIRE_A if k == 0 else WIRE_B
        dw = (w_a if k == 0 else w_b) - x[TRAVEL + k]
        if dw != 0.0:
            kw = secant_stiffness(x, wire, table, p, on, dw) * dw
            move(x, wire, table, MOTOR_END, kw, x[FLOOR])
    dw = 0.5 * (w_a - x[TRAVEL] - w_b + x[TRAVEL + 1])
    x[TRAVEL], x[TRAVEL + 1] = w_a, w_b
    return dw


@compiled
def advance_tick(
    x: Array, history: Array, sheath: Array, p: Array, on: Flags, inputs: Array, tick: float
) -> None:
    """Advance one joint, as `settle` left it, by one tick with `inputs` (INPUTS,) in force."""
    table = sheath[:TABLE_ROWS]
    time = (x[TICKS] + 0.5) * tick
    x[NOW], x[OTHER] = time, inputs[IN_OTHER_JOINT]
    history[COMMAND_HISTORY, int(x[TICKS]) % HISTORY] = inputs[IN_COMMAND]

    turn_motor(x, history, table, p, on, inputs, tick)
    if exponent_varies(on):
        _change_friction(x, sheath, p, on, abs(x[WINDING_SPEED]), time, tick)
    if length_varies(on):
        _grow(x, table, p, on, time)
    w = _wind_up(x, table, p, on, x[MOTOR])
    x[WINDING_SPEED] = w / tick
    bend(x, table, p, on, w, inputs[IN_OTHER_JOINT], time, tick)
    x[TIP] = tip_angle(on, p, x, x[JOINT])
    x[TICKS] += 1.0
    if something_follows(on):
        load_a = mean_tension(x, WIRE_A, table) - x[FLOOR]
        load_b = mean_tension(x, WIRE_B, table) - x[FLOOR]
        advance(on, p, x, load_a, load_b, time, tick)
    if functions_follow(on):
        _keep_up(x, table, p, on, tick)


@compiled
def tensions(x: Array, sheath: Array, end: int) -> tuple[float, float]:
    """Tensions in N of both wires at `MOTOR_END` or `JOINT_END`."""
    table = sheath[:TABLE_ROWS]
    i = 0 if end == MOTOR_END else CELLS
    # Viscous drag adds to the tension at the motor and takes from that at the joint, half each.
    half = 0.5 if end == MOTOR_END else -0.5
    t_a = node_tension(x, WIRE_A, table, i) - x[FLOOR] + half * x[FILM]
    t_b = node_tension(x, WIRE_B, table, i) - x[FLOOR] + half * x[FILM + 1]
    return max(0.0, t_a), max(0.0, t_b)


@compiled
def read_sensors(
    x: Array, history: Array, sheath: Array, p: Array, on: Flags, tick: float, out: Array
) -> None:
    """Write what the noise-free sensors read now into `out` (OUTPUTS,); once a tick."""
    time, place = x[TICKS] * tick, int(x[TICKS]) % HISTORY
    t_a, t_b = tensions(x, sheath, MOTOR_END)
    history[ANGLE_HISTORY, place] = x[TIP]
    history[TENSION_HISTORY, place], history[TENSION_HISTORY + 1, place] = t_a, t_b
    out[OUT_MOTOR] = x[MOTOR]
    out[OUT_MOTOR_SPEED] = x[MOTOR_SPEED]
    out[OUT_EFFORT] = effort_reading(on, p, x, p[PULLEY_RADIUS] * (t_a - t_b), x[MOTOR_SPEED])
    converted_a = cell_input(on, p, x, t_a, 0, history, tick)
    converted_b = cell_input(on, p, x, t_b, 1, history, tick)
    out[OUT_TENSION_A] = load_cell_reading(on, p, x, converted_a, 0, t_b, time)
    out[OUT_TENSION_B] = load_cell_reading(on, p, x, converted_b, 1, t_a, time)
    out[OUT_BENDING] = tracker_reading(on, p, x, x[TIP], history, time, tick)
    out[OUT_JOINT] = x[TIP]


@compiled
def run_joints(
    x: Array,
    histories: Array,
    sheaths: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    coupled: bool,
    tick: float,
    out: Array,
) -> None:
    """Run J joints side by side over `inputs` (J, N, INPUTS), into `out` (J, N or more, OUTPUTS).

    The joints are rows of `settle`'s arrays. Row k of `out` is what the sensors read at tick k,
    before command k acts; one row more than commands is what they read after the last. Where
    `coupled`, each joint's angle is written into the other's input.
    """
    joints = inputs.shape[0]
    for n in range(out.shape[1]):
        for j in range(joints):
            read_sensors(x[j], histories[j], sheaths[j], p[j], on[j], tick, out[j, n])
        for j in range(joints if n < inputs.shape[1] else 0):
            row = inputs[j, n]
            if coupled and joints > 1:
                row[IN_OTHER_JOINT] = out[1 - j, n, OUT_JOINT]
            advance_tick(x[j], histories[j], sheaths[j], p[j], on[j], row, tick)

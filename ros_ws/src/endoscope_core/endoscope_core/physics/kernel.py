"""One bending joint, tick by tick: servo, pair of wires in their sheaths, joint, readings.

No effect is named here: what can be added to the nominal plant acts through the hooks.
"""

import math

import numpy as np

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics import hooks
from endoscope_core.physics.folds import acting, folded, follow, some_of, sum_of
from endoscope_core.physics.functions import FUNCTIONS
from endoscope_core.physics.functions.acting import functions_act
from endoscope_core.physics.functions.interpolation import LAG
from endoscope_core.physics.joint import bend, stiffness_on_the_way
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
    IN_MOTOR,
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
    WIRE_STIFFNESS,
    WORK,
)
from endoscope_core.physics.servo import transition
from endoscope_core.physics.sheath import (
    MOTOR_END,
    NODES,
    TABLE_ROWS,
    lengthen,
    mean_tension,
    move,
    moved,
    node_tension,
    relax,
    slide_on,
    sliding_load,
    spread,
    tabulate,
)

command_at_servo = folded(hooks.COMMAND)
servo_error = folded(hooks.SERVO_ERROR)
largest_torque, torque_is_limited = folded(hooks.TORQUE), acting(hooks.TORQUE)
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
command_functions = sum_of(hooks.COMMAND)
error_functions = sum_of(hooks.SERVO_ERROR)
pulley_functions = sum_of(hooks.PULLEY_ANGLE)
travel_functions = sum_of(hooks.TRAVEL_OF)
exponent_functions, exponent_has_some = sum_of(hooks.EXPONENT), some_of(hooks.EXPONENT)
length_functions, length_has_some = sum_of(hooks.LENGTH), some_of(hooks.LENGTH)
effort_functions = sum_of(hooks.EFFORT)
tracker_functions = sum_of(hooks.TRACKER)
load_cell_functions = sum_of(hooks.LOAD_CELL)
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
_TRIES = 40
_SAME_FACTOR = 1e-12
_TORQUE_PRECISION = 1e-11
"""N m."""


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
    x[FLOOR] = friction_floor(on, p, x)
    # Friction that depends on the tension has to be known before the tension is.
    x[MEAN_TENSION] = p[PRETENSION]
    factor = exponent_factor(on, p, x, 0.0, -0.5 * tick, tick)
    if functions_act(on):
        factor *= exponent_functions(on, p, x, 0.0, -0.5 * tick, tick)
    _shape(x, sheath, p, on, factor)
    table = sheath[:TABLE_ROWS]
    for wire in (WIRE_A, WIRE_B):
        for i in range(CELLS + 1):
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
        if length_varies(on) or (functions_act(on) and length_has_some(on)):
            _grow(x, table, p, on, 0.0)
        x[MOTOR] = begin + (shaft - begin) * k / steps
        _wind_up(x, table, p, on, x[MOTOR])
        bend(x, table, p, on, 0.0, 0.0, -0.5 * _SETTLING_TICK, _SETTLING_TICK)
        if functions_act(on) and functions_follow(on):
            _keep_up(x, table, p, on, 0.0)
    for wire in range(2):
        x[FILM + wire] = 0.0
    x[SLIDING_SPEED] = x[JOINT_STEP] = 0.0
    x[TIP] = x[JOINT]
    history[ANGLE_HISTORY, :] = x[TIP]
    ta, tb = tensions(x, sheath, MOTOR_END)
    history[TENSION_HISTORY, :], history[TENSION_HISTORY + 1, :] = ta, tb


@compiled
def _keep_up(x: Array, table: Array, p: Array, on: Flags, tick: float) -> None:
    """Let the states follow that only functions depend on; in no time they are where they go."""
    load_a = mean_tension(x, WIRE_A, table) - x[FLOOR]
    load_b = mean_tension(x, WIRE_B, table) - x[FLOOR]
    x[MEAN_TENSION] = 0.5 * (load_a + load_b)
    x[TENSION_DIFFERENCE] = load_a - load_b
    x[PATH] += abs(x[SLIDING_SPEED]) * tick
    if on[_LENGTH_LAGS[0]]:
        way = _way(tick, p[_LENGTH_LAGS[1]])
        x[LAGGED_LOAD] += way * (load_a - x[LAGGED_LOAD])
        x[LAGGED_LOAD + 1] += way * (load_b - x[LAGGED_LOAD + 1])
    if on[_EXPONENT_LAGS[0]]:
        way = _way(tick, p[_EXPONENT_LAGS[1]])
        x[LAGGED_SPEED] += way * (abs(x[SLIDING_SPEED]) - x[LAGGED_SPEED])
    if on[_LOAD_LAGS[0]]:
        way = _way(tick, p[_LOAD_LAGS[1]])
        x[LAGGED_ANGLE] += way * (x[JOINT] - x[LAGGED_ANGLE])


@compiled
def _way(tick: float, lag: float) -> float:
    """Share of the way to what it follows that a lagging argument goes in a tick; all at none."""
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
    exponent = 0.0
    for j in range(PROFILE_TERMS):
        if p[FRICTION_PROFILE + j] != 0.0:
            exponent += p[FRICTION_PROFILE + j] * math.cos((j + 1) * math.pi * place)
    return math.exp(exponent)


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
    if functions_act(on):
        factor *= exponent_functions(on, p, x, speed, time, tick)
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
        if functions_act(on):
            length += length_functions(on, p, x, k, time)
        grown = length - x[EXTRA_LENGTH + k]
        if grown != 0.0:
            force = stiffness_on_the_way(x, wire, table, p, on, -grown) * grown
            lengthen(x, wire, table, force, x[FLOOR])
            x[EXTRA_LENGTH + k] = length


@compiled
def _travels(x: Array, p: Array, on: Flags, pulley: float) -> tuple[float, float]:
    wound = p[PULLEY_RADIUS] * pulley
    return travel_of(on, p, x, wound, 0), travel_of(on, p, x, -wound, 1)


@compiled
def _travels_with_functions(x: Array, p: Array, on: Flags) -> tuple[float, float]:
    x[PULLEY] += pulley_functions(on, p, x, x[PULLEY])
    travel_a, travel_b = _travels(x, p, on, x[PULLEY])
    added_a = travel_functions(on, p, x, travel_a, 0)
    return travel_a + added_a, travel_b + travel_functions(on, p, x, travel_b, 1)


@compiled
def _wind_up(x: Array, table: Array, p: Array, on: Flags, shaft: float) -> float:
    """Turn the shaft to an angle; returns by how much the positive wire has moved, m."""
    x[PULLEY] = pulley_angle(on, p, x, shaft)
    if functions_act(on):
        travel_a, travel_b = _travels_with_functions(x, p, on)
    else:
        travel_a, travel_b = _travels(x, p, on, x[PULLEY])
    for k in range(2):
        wire = WIRE_A if k == 0 else WIRE_B
        travel = travel_a if k == 0 else travel_b
        way = travel - x[TRAVEL + k]
        if way != 0.0:
            force = stiffness_on_the_way(x, wire, table, p, on, way) * way
            move(x, wire, table, MOTOR_END, force, x[FLOOR])
    way = 0.5 * (travel_a - x[TRAVEL] - travel_b + x[TRAVEL + 1])
    x[TRAVEL], x[TRAVEL + 1] = travel_a, travel_b
    return way


@compiled
def _torque(x: Array, table: Array, p: Array, on: Flags, step: float) -> float:
    """Torque of the wires on the pulley in N m once it has turned by `step` rad."""
    force = p[WIRE_STIFFNESS] * p[PULLEY_RADIUS] * step
    ta, _, _, _, _, _ = moved(x, WIRE_A, table, MOTOR_END, force, x[FLOOR])
    tb, _, _, _, _, _ = moved(x, WIRE_B, table, MOTOR_END, -force, x[FLOOR])
    return p[PULLEY_RADIUS] * (ta - tb)


@compiled
def _unbearable(
    x: Array, table: Array, p: Array, on: Flags, step: float, way: float, tick: float
) -> float:
    """Torque in N m by which the wires load the motor with more than it can bear."""
    load = way * _torque(x, table, p, on, step)
    return load - largest_torque(on, p, x, way * step / tick)


@compiled
def _yield(x: Array, table: Array, p: Array, on: Flags, step: float, tick: float) -> float:
    """Step of the motor in rad, cut where the wires load it with more than it can bear.

    The load grows with the step and the bearable falls with the speed of a motor that drives its
    load: one step divides them, which a bracketed secant finds (Dowell, Jarratt, BIT 11, 1971).
    """
    load = _torque(x, table, p, on, step)
    way = 1.0 if load > 0.0 else -1.0
    far, far_excess = step, abs(load) - largest_torque(on, p, x, way * step / tick)
    if far_excess <= 0.0:
        return step
    back = max(1e-4, abs(step))
    near = min(0.0, way * step) * way
    near_excess = _unbearable(x, table, p, on, near, way, tick)
    for _ in range(_TRIES):
        if near_excess <= 0.0:
            break
        far, far_excess = near, near_excess
        near -= way * back
        back *= 2.0
        near_excess = _unbearable(x, table, p, on, near, way, tick)
    for _ in range(_TRIES):
        if abs(far_excess) <= _TORQUE_PRECISION or far_excess == near_excess:
            break
        found = far - far_excess * (far - near) / (far_excess - near_excess)
        excess = _unbearable(x, table, p, on, found, way, tick)
        if excess * far_excess > 0.0:
            near_excess *= max(0.5, 1.0 - excess / far_excess)
        else:
            near, near_excess = far, far_excess
        far, far_excess = found, excess
    return far


@compiled
def advance_tick(
    x: Array, history: Array, sheath: Array, p: Array, on: Flags, inputs: Array, tick: float
) -> None:
    """Advance one joint, as `settle` left it, by one tick with `inputs` (INPUTS,) in force."""
    table = sheath[:TABLE_ROWS]
    time = (x[TICKS] + 0.5) * tick
    other = inputs[IN_OTHER_JOINT]
    x[NOW], x[OTHER] = time, other
    history[COMMAND_HISTORY, int(x[TICKS]) % HISTORY] = inputs[IN_COMMAND]

    if math.isnan(inputs[IN_MOTOR]):
        command = command_at_servo(on, p, x, inputs[IN_COMMAND], history, tick)
        if functions_act(on):
            command += command_functions(on, p, x, command, history, tick)
        from_error, kept = x[TRANSITION + 2], x[TRANSITION + 3]
        error = servo_error(on, p, x, x[MOTOR] - command, from_error, kept)
        if functions_act(on):
            error += error_functions(on, p, x, error, from_error, kept)
        target = x[MOTOR] - error
        speed = from_error * error + kept * x[MOTOR_SPEED]
        shaft = target + x[TRANSITION] * error + x[TRANSITION + 1] * x[MOTOR_SPEED]
        if torque_is_limited(on):
            step = _yield(x, table, p, on, shaft - x[MOTOR], tick)
            if step != shaft - x[MOTOR]:
                shaft, speed = x[MOTOR] + step, step / tick
    else:
        shaft = inputs[IN_MOTOR]
        speed = (shaft - x[MOTOR]) / tick
    x[MOTOR], x[MOTOR_SPEED] = shaft, speed

    if exponent_varies(on) or (functions_act(on) and exponent_has_some(on)):
        _change_friction(x, sheath, p, on, abs(x[WINDING_SPEED]), time, tick)
    if length_varies(on) or (functions_act(on) and length_has_some(on)):
        _grow(x, table, p, on, time)
    way = _wind_up(x, table, p, on, shaft)
    x[WINDING_SPEED] = way / tick
    bend(x, table, p, on, way, other, time, tick)
    x[TIP] = tip_angle(on, p, x, x[JOINT])
    x[TICKS] += 1.0
    if something_follows(on):
        load_a = mean_tension(x, WIRE_A, table) - x[FLOOR]
        load_b = mean_tension(x, WIRE_B, table) - x[FLOOR]
        advance(on, p, x, load_a, load_b, time, tick)
    if functions_act(on) and functions_follow(on):
        _keep_up(x, table, p, on, tick)


@compiled
def tensions(x: Array, sheath: Array, end: int) -> tuple[float, float]:
    """Tensions in N of both wires at `MOTOR_END` or `JOINT_END`."""
    table = sheath[:TABLE_ROWS]
    i = 0 if end == MOTOR_END else CELLS
    way = 0.5 if end == MOTOR_END else -0.5
    ta = node_tension(x, WIRE_A, table, i) - x[FLOOR] + way * x[FILM]
    tb = node_tension(x, WIRE_B, table, i) - x[FLOOR] + way * x[FILM + 1]
    return max(0.0, ta), max(0.0, tb)


@compiled
def read_sensors(
    x: Array, history: Array, sheath: Array, p: Array, on: Flags, tick: float, out: Array
) -> None:
    """Write what the noise-free sensors read now into `out` (OUTPUTS,); once a tick."""
    time, place = x[TICKS] * tick, int(x[TICKS]) % HISTORY
    ta, tb = tensions(x, sheath, MOTOR_END)
    history[ANGLE_HISTORY, place] = x[TIP]
    history[TENSION_HISTORY, place], history[TENSION_HISTORY + 1, place] = ta, tb
    out[OUT_MOTOR] = x[MOTOR]
    out[OUT_MOTOR_SPEED] = x[MOTOR_SPEED]
    out[OUT_EFFORT] = effort_reading(on, p, x, p[PULLEY_RADIUS] * (ta - tb), x[MOTOR_SPEED])
    converted_a = cell_input(on, p, x, ta, 0, history, tick)
    converted_b = cell_input(on, p, x, tb, 1, history, tick)
    out[OUT_TENSION_A] = load_cell_reading(on, p, x, converted_a, 0, tb, time)
    out[OUT_TENSION_B] = load_cell_reading(on, p, x, converted_b, 1, ta, time)
    out[OUT_BENDING] = tracker_reading(on, p, x, x[TIP], history, time, tick)
    if functions_act(on):
        a, b, angle = out[OUT_TENSION_A], out[OUT_TENSION_B], out[OUT_BENDING]
        out[OUT_EFFORT] += effort_functions(on, p, x, out[OUT_EFFORT], x[MOTOR_SPEED])
        out[OUT_TENSION_A] += load_cell_functions(on, p, x, a, 0, tb, time)
        out[OUT_TENSION_B] += load_cell_functions(on, p, x, b, 1, ta, time)
        out[OUT_BENDING] += tracker_functions(on, p, x, angle, history, time, tick)
    out[OUT_JOINT] = x[TIP]


@compiled
def advance_joints(
    x: Array,
    histories: Array,
    sheaths: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    ticks: int,
    tick: float,
    out: Array,
) -> None:
    """Advance J joints side by side by some ticks, with `inputs` (J, INPUTS) in each.

    The joints are rows of `settle`'s arrays. Their readings after the last tick go into `out`
    (J, OUTPUTS); 0 ticks only read the sensors. Of two joints, each one's angle is written into the
    other's input.
    """
    joints = inputs.shape[0]
    for n in range(ticks + 1):
        for j in range(joints):
            read_sensors(x[j], histories[j], sheaths[j], p[j], on[j], tick, out[j])
        for j in range(joints if n < ticks else 0):
            if joints == 2:
                inputs[j, IN_OTHER_JOINT] = out[1 - j, OUT_JOINT]
            advance_tick(x[j], histories[j], sheaths[j], p[j], on[j], inputs[j], tick)


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
    """Run J joints side by side over `inputs` (J, N, INPUTS), into `out` (J, N, OUTPUTS).

    The joints are rows of `settle`'s arrays. Row k of `out` is what the sensors read at tick k,
    before command k acts. Where `coupled`, each joint's angle is written into the other's input.
    """
    joints, ticks = inputs.shape[0], inputs.shape[1]
    for n in range(ticks):
        for j in range(joints):
            read_sensors(x[j], histories[j], sheaths[j], p[j], on[j], tick, out[j, n])
        for j in range(joints):
            row = inputs[j, n]
            if coupled and joints > 1:
                row[IN_OTHER_JOINT] = out[1 - j, n, OUT_JOINT]
            advance_tick(x[j], histories[j], sheaths[j], p[j], on[j], row, tick)

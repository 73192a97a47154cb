"""The compiled physics of one bending joint: nominal plant plus the effects that are on.

Angles named `u`, `m`, `q` are joint-equivalent. The servo's linear loop is integrated exactly for
a command held over the substep; joint and pre-sliding states by a linearly implicit midpoint rule
(Hairer, Wanner, Solving ODEs II, ch. IV.7), which stays stable through the stiff reversals.
"""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import (
    cogging,
    distributed_friction,
    friction_run_in,
    gear_backlash,
    joint_backlash,
    joint_inertia,
    presliding_shape,
    stribeck_friction,
    torque_limit,
    viscous_friction,
    wire_creep,
)
from endoscope_core.effects.presliding_shape import JOINT as AT_JOINT
from endoscope_core.effects.presliding_shape import WIRE_A, WIRE_B
from endoscope_core.effects.slots import (
    COMMAND_HISTORY,
    HISTORY,
    JOINT,
    JOINT_FRICTION,
    JOINT_PRESLIDING,
    JOINT_RADIUS,
    JOINT_SLIDE,
    JOINT_SPEED,
    MOTOR,
    MOTOR_BANDWIDTH,
    MOTOR_DAMPING_RATIO,
    MOTOR_SPEED,
    PRESLIDING_DISTANCE,
    PULLEY,
    PULLEY_SPEED,
    SLIDE_A,
    SLIDE_B,
    TENSION_A,
    TENSION_B,
    TICKS,
    TIP,
    WIRE_END,
    WIRE_END_SPEED,
)
from endoscope_core.plant import presliding, sheath_chain
from endoscope_core.plant.actuator import (
    pulley_angle,
    servo_command,
    servo_step,
    servo_transition,
)
from endoscope_core.plant.inputs import (
    IN_COMMAND,
    IN_MOTOR,
    IN_OTHER_JOINT,
    IN_PUSH_COMMAND,
    IN_PUSH_MOMENT,
    IN_PUSH_STRETCH,
    INPUTS,
    OUT_BENDING,
    OUT_EFFORT,
    OUT_JOINT,
    OUT_MOTOR,
    OUT_MOTOR_SPEED,
    OUT_TENSION_A,
    OUT_TENSION_B,
    OUTPUTS,
)
from endoscope_core.plant.joint import load
from endoscope_core.plant.proximal import proximal_tensions, stretch_shift
from endoscope_core.plant.readings import read_sensors
from endoscope_core.plant.transmission import (
    friction_exponent,
    half_exponent,
    is_distributed,
    pretension_now,
    wire_tension,
)

__all__ = [
    'INPUTS',
    'IN_COMMAND',
    'IN_MOTOR',
    'IN_OTHER_JOINT',
    'IN_PUSH_COMMAND',
    'IN_PUSH_MOMENT',
    'IN_PUSH_STRETCH',
    'OUTPUTS',
    'OUT_BENDING',
    'OUT_EFFORT',
    'OUT_JOINT',
    'OUT_MOTOR',
    'OUT_MOTOR_SPEED',
    'OUT_TENSION_A',
    'OUT_TENSION_B',
    'advance_joints',
    'advance_tick',
    'run_joints',
]


@compiled
def advance_tick(
    state: Array,
    history: Array,
    p: Array,
    on: Flags,
    u: float,
    x: Array,
    tick: float,
    substeps: int,
) -> None:
    """Advance one joint by one tick with the input row `x` and command `u` in force.

    Parameters
    ----------
    state, history : array (states,), array (2, HISTORY)
        Changed in place.
    p, on : array (parameters,), array (flags,) of bool
        Parameters and effects in force.
    u : float
        Command in rad, joint-equivalent.
    x : array (INPUTS,)
        Other inputs; see `INPUTS`.
    tick : float
        Length in s.
    substeps : int
        Integration steps in the tick.
    """
    lagging = stribeck_friction.is_lagging(p, on)
    dt = tick / substeps
    width = 1.0 / substeps
    start = state[TICKS] * tick
    history[COMMAND_HISTORY, int(state[TICKS]) % HISTORY] = u
    r = p[JOINT_RADIUS]
    xs = p[PRESLIDING_DISTANCE]
    qs = p[JOINT_PRESLIDING]
    if on[presliding_shape.ON]:
        presliding_shape.prepare(state, p)
    transition = servo_transition(p[MOTOR_BANDWIDTH], p[MOTOR_DAMPING_RATIO], dt)
    driven = not math.isnan(x[IN_MOTOR])
    driven_speed = (x[IN_MOTOR] - state[MOTOR]) / tick if driven else 0.0
    geared = on[gear_backlash.ON] or on[cogging.ON]
    chained = is_distributed(p, on)
    loaded_tip = joint_backlash.tip_is_loaded(p, on) and not chained
    shift = stretch_shift(p, on, x)
    m, dm, pulley, pulley_speed = state[MOTOR], state[MOTOR_SPEED], state[PULLEY], 0.0
    q, dq, wire_end = state[JOINT], state[JOINT_SPEED], state[WIRE_END]
    wire_end_speed = state[WIRE_END_SPEED]
    za, zb, zj = state[SLIDE_A], state[SLIDE_B], state[JOINT_SLIDE]
    for i in range(substeps):
        time = start + (i + 0.5) * dt
        pretension = pretension_now(p, on, time)

        if driven:
            m_new, dm_new = m + dt * driven_speed, driven_speed
        else:
            command = servo_command(state, history, p, on, u, i * width, width, tick)
            m_new, dm_new = servo_step(p, on, transition, m, dm, command + x[IN_PUSH_COMMAND])
            if on[torque_limit.ON]:
                state[SLIDE_A], state[SLIDE_B] = za, zb
                v = 0.5 * r * (state[PULLEY_SPEED] + wire_end_speed)
                phi, _ = friction_exponent(state, p, on, v, 0.0, time, tick)
                stretch = r * (pulley - wire_end) + shift
                loads = proximal_tensions(state, p, on, pretension, phi, v, stretch, shift)
                step = torque_limit.yielding(p, m_new - m, loads, dt)
                if step != m_new - m:
                    m_new, dm_new = m + step, step / dt
        pulley_new = pulley_angle(state, p, on, m_new) if geared else m_new
        pulley_speed = (pulley_new - pulley) / dt

        v = 0.5 * r * (pulley_speed + wire_end_speed)
        phi, shudder = friction_exponent(state, p, on, v, 0.5 * dt, time, tick)
        shake = shudder * dt / xs
        # The wires' mean speed is half the motor's and half the joint's, and it is the joint's
        # half that shudders.
        joint_shudder = 2.0 * shudder / r
        wire_step = r * (pulley_new - pulley)
        stretch = r * (0.5 * (pulley + pulley_new) - wire_end) + shift
        if chained:
            ta, tb, ka, kb = sheath_chain.distal_tensions(
                state, p, on, pretension, shift, phi, wire_step
            )
            phi *= 1.0 - p[distributed_friction.SHARE]
        else:
            ca, cb = state[wire_creep.CREEP_A], state[wire_creep.CREEP_B]
            ta, ka = wire_tension(p, on, pretension, stretch - ca)
            tb, kb = wire_tension(p, on, pretension, -stretch - cb)
        ea, grip_a = half_exponent(p, on, phi, za, v)
        eb, grip_b = half_exponent(p, on, phi, zb, -v)
        da, db = math.exp(-ea), math.exp(-eb)
        state[stribeck_friction.BRAKING] = abs(ta * da * za - tb * db * zb)

        steep_a = presliding.steepness(state, p, on, WIRE_A, za, v, shudder)
        steep_b = presliding.steepness(state, p, on, WIRE_B, zb, -v, shudder)
        steep_j = presliding.steepness(state, p, on, AT_JOINT, zj, dq, joint_shudder)
        pull = r * (ta * da - tb * db)
        grip = 0.5 * r * r / xs * (grip_a * ta * da * steep_a + grip_b * tb * db * steep_b)
        pull_slope = r * r * (ka * da + kb * db) + grip
        # The half step of sliding that the motor alone causes; the joint's share is in the slope.
        pull -= 0.5 * dt * grip * pulley_speed
        drag = 0.0
        if lagging and not loaded_tip:
            falls = stribeck_friction.steepness(state, p, v, 0.5 * dt)
            falls *= 0.25 * phi * r * r * (ta * da * za - tb * db * zb)
            pull += falls * wire_end_speed
            drag += falls
        if on[viscous_friction.ON]:
            film = 0.5 * r * r * viscous_friction.film(p, v)
            loaded = 0.25 * r * r * p[viscous_friction.LOAD_FACTOR] * (ta * da + tb * db)
            pull += loaded * wire_end_speed - film * pulley_speed
            drag += loaded + film
        offset, give = 0.0, 0.0
        if loaded_tip:
            drag += p[joint_backlash.WIRE_END_DAMPING]
            offset, pull, touching = joint_backlash.through_gap(
                p, wire_end - q, pull, pull_slope + drag / dt
            )
            pull_slope *= touching
            drag *= touching
            give = 1.0 - touching

        moment, slope, damping = load(p, on, x, q, time, tick)
        moment += pull - p[JOINT_FRICTION] * zj
        slope += pull_slope + p[JOINT_FRICTION] / qs * steep_j
        resistance = damping + drag
        resistance += 0.5 * dt * max(slope, 0.0)
        if lagging:
            resistance = max(resistance, stribeck_friction.LEAST_RESISTANCE * damping)
        mean_dq = moment / resistance
        if on[joint_inertia.ON]:
            mean_dq, dq = joint_inertia.speeds(p, dq, mean_dq, resistance, dt)
        else:
            dq = mean_dq

        q += mean_dq * dt
        # A wire end that is free, or on soft flanks, does not go where the tip goes.
        offset -= give * mean_dq * dt
        wire_end_speed = (q + offset - wire_end) / dt if loaded_tip else mean_dq
        wire_end = q + offset
        slid = 0.5 * r * (pulley_speed + wire_end_speed) * dt
        za = presliding.slid(state, p, on, WIRE_A, za, slid / xs, shake)
        zb = presliding.slid(state, p, on, WIRE_B, zb, -slid / xs, shake)
        zj = presliding.slid(state, p, on, AT_JOINT, zj, mean_dq * dt / qs, joint_shudder * dt / qs)
        if chained:
            sheath_chain.follow(state, p, shake, wire_step, r * mean_dq * dt)
        if on[wire_creep.ON]:
            mean_a, mean_b = ta, tb
            if chained:
                # Each piece creeps under its own tension, the whole wire under their mean.
                mean_a, _ = wire_tension(p, on, pretension, stretch - state[wire_creep.CREEP_A])
                mean_b, _ = wire_tension(p, on, pretension, -stretch - state[wire_creep.CREEP_B])
            wire_creep.advance(state, p, mean_a - pretension, mean_b - pretension, dt)
        if on[friction_run_in.ON]:
            friction_run_in.advance(state, slid)
        if lagging:
            stribeck_friction.remember(state, p, slid / dt, dt)
        m, dm, pulley = m_new, dm_new, pulley_new
        state[PULLEY_SPEED] = pulley_speed

    state[MOTOR], state[MOTOR_SPEED], state[PULLEY] = m, dm, pulley
    state[JOINT], state[JOINT_SPEED] = q, dq
    state[WIRE_END], state[WIRE_END_SPEED] = wire_end, wire_end_speed
    state[SLIDE_A], state[SLIDE_B], state[JOINT_SLIDE] = za, zb, zj
    play_behind_joint = on[joint_backlash.ON] and not loaded_tip
    state[TIP] = joint_backlash.tip(state, p, q) if play_behind_joint else q
    state[TICKS] += 1.0
    if not geared:
        pulley_speed = dm
    v = 0.5 * r * (pulley_speed + (wire_end_speed if loaded_tip else dq))
    end = state[TICKS] * tick
    phi, _ = friction_exponent(state, p, on, v, 0.0, end, tick)
    loads = proximal_tensions(
        state, p, on, pretension_now(p, on, end), phi, v, r * (pulley - wire_end) + shift, shift
    )
    state[TENSION_A], state[TENSION_B] = loads[0], loads[1]


@compiled
def advance_joints(
    states: Array,
    histories: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    ticks: int,
    tick: float,
    substeps: int,
    out: Array,
) -> None:
    """Advance all joints side by side by some ticks, with the same input in each.

    Parameters
    ----------
    states, histories : array (J, states), array (J, 2, HISTORY)
        Changed in place.
    p, on : array (J, parameters), array (J, flags) of bool
    inputs : array (J, INPUTS)
        Two joints see each other's angle, which is written into it.
    ticks : int
        0 only reads the sensors.
    tick : float
    substeps : int
    out : array (J, OUTPUTS)
        What the sensors read after the ticks.
    """
    joints = inputs.shape[0]
    for n in range(ticks + 1):
        for j in range(joints):
            read_sensors(states[j], histories[j], p[j], on[j], tick, out[j])
        for j in range(joints if n < ticks else 0):
            x = inputs[j]
            if joints == 2:
                x[IN_OTHER_JOINT] = out[1 - j, OUT_JOINT]
            advance_tick(states[j], histories[j], p[j], on[j], x[IN_COMMAND], x, tick, substeps)


@compiled
def run_joints(
    states: Array,
    histories: Array,
    p: Array,
    on: Flags,
    inputs: Array,
    coupled: bool,
    tick: float,
    substeps: int,
    out: Array,
) -> None:
    """Run all joints side by side over a whole input.

    Parameters
    ----------
    states, histories : array (J, states), array (J, 2, HISTORY)
        Changed in place.
    p, on : array (J, parameters), array (J, flags) of bool
    inputs : array (J, N, INPUTS)
        Changed where `coupled`.
    coupled : bool
        Whether each joint sees the other's angle, which is then written into its input.
    tick : float
    substeps : int
    out : array (J, N, OUTPUTS)
        Row k is what the sensors read at tick k, before command k acts.
    """
    joints, ticks = inputs.shape[0], inputs.shape[1]
    for n in range(ticks):
        for j in range(joints):
            read_sensors(states[j], histories[j], p[j], on[j], tick, out[j, n])
        for j in range(joints):
            x = inputs[j, n]
            if coupled and joints > 1:
                x[IN_OTHER_JOINT] = out[1 - j, n, OUT_JOINT]
            advance_tick(states[j], histories[j], p[j], on[j], x[IN_COMMAND], x, tick, substeps)

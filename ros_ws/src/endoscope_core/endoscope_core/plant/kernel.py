"""The compiled physics of one bending joint: nominal plant plus the effects that are on.

Angles named `u`, `m`, `q` are joint-equivalent. The servo's linear loop is integrated exactly for
a command held over the substep; joint and pre-sliding states by a linearly implicit midpoint rule
(Hairer, Wanner, Solving ODEs II, ch. IV.7), which stays stable through the stiff reversals.
"""

import math

from endoscope_core.compiled_cache import njit
from endoscope_core.effects import joint_stop, stribeck_friction, transport_delay
from endoscope_core.effects.slots import (
    ANGLE_HISTORY,
    CAPSTAN_EXPONENT,
    COMMAND_HISTORY,
    HISTORY,
    JOINT,
    JOINT_DAMPING,
    JOINT_FRICTION,
    JOINT_PRESLIDING,
    JOINT_RADIUS,
    JOINT_SLIDE,
    JOINT_SPEED,
    JOINT_STIFFNESS,
    MOTOR,
    MOTOR_BANDWIDTH,
    MOTOR_DAMPING_RATIO,
    MOTOR_SPEED,
    PRESLIDING_DISTANCE,
    PRETENSION,
    PULLEY,
    PULLEY_RADIUS,
    SLIDE_A,
    SLIDE_B,
    TENSION_A,
    TENSION_B,
    TICKS,
    WIRE_STIFFNESS,
)

OUT_MOTOR, OUT_MOTOR_SPEED, OUT_EFFORT, OUT_TENSION_A, OUT_TENSION_B, OUT_BENDING, OUT_JOINT = (
    range(7))
OUTPUTS = 7

IN_COMMAND, IN_OTHER_JOINT, IN_MOTOR, IN_PUSH_COMMAND, IN_PUSH_STRETCH, IN_PUSH_MOMENT = range(6)
INPUTS = 6
"""Columns of the input: command u, the other joint's angle, measured motor angle (NaN: let the
servo run), and latent pushes added to command (rad), wire stretch (m) and joint moment (N m)."""


@njit(cache=True)
def servo_transition(bandwidth, damping_ratio, step):
    """Exact transition of the servo over `step` s: rows of the matrix on (m - u, m')."""
    sigma = damping_ratio * bandwidth
    discriminant = damping_ratio * damping_ratio - 1.0
    decay = math.exp(-sigma * step)
    if discriminant < -1e-9:
        w = bandwidth * math.sqrt(-discriminant)
        c, s = math.cos(w * step), math.sin(w * step) / w
    elif discriminant > 1e-9:
        w = bandwidth * math.sqrt(discriminant)
        c, s = math.cosh(w * step), math.sinh(w * step) / w
    else:
        c, s = 1.0, step
    return (decay * (c + sigma * s), decay * s,
            -decay * bandwidth * bandwidth * s, decay * (c - sigma * s))


@njit(cache=True)
def presliding_step(slide, ratio):
    """Dahl state after sliding `ratio` pre-sliding distances (signed); stays in [-1, 1]."""
    size = abs(ratio)
    share = 1.0 - math.exp(-size) if size > 0.02 else size - 0.5 * size * size
    return slide + share * ((1.0 if ratio > 0.0 else -1.0) - slide)


@njit(cache=True)
def advance_tick(state, history, p, on, u, x, tick, substeps):
    """Advance one joint by one tick with the input row `x` and command `u` in force.

    Parameters
    ----------
    state : array (states,), history : array (2, HISTORY)
        Changed in place.
    p : array (parameters,), on : array (flags,) of bool
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
    dt = tick / substeps
    width = 1.0 / substeps
    history[COMMAND_HISTORY, int(state[TICKS]) % HISTORY] = u
    r = p[JOINT_RADIUS]
    k = p[WIRE_STIFFNESS]
    phi0 = p[CAPSTAN_EXPONENT]
    xs = p[PRESLIDING_DISTANCE]
    a11, a12, a21, a22 = servo_transition(p[MOTOR_BANDWIDTH], p[MOTOR_DAMPING_RATIO], dt)
    driven = not math.isnan(x[IN_MOTOR])
    driven_speed = (x[IN_MOTOR] - state[MOTOR]) / tick if driven else 0.0
    m, dm, q, dq = state[MOTOR], state[MOTOR_SPEED], state[JOINT], state[JOINT_SPEED]
    za, zb, zj = state[SLIDE_A], state[SLIDE_B], state[JOINT_SLIDE]
    for i in range(substeps):
        command = u
        if on[transport_delay.ON]:
            command = transport_delay.delayed_command(state, p, history, i * width, width, tick)
        command += x[IN_PUSH_COMMAND]
        if driven:
            m_new, dm_new = m + dt * driven_speed, driven_speed
        else:
            error = m - command
            m_new = command + a11 * error + a12 * dm
            dm_new = a21 * error + a22 * dm
        sliding_motor = (m_new - m) / dt
        pulley = 0.5 * (m + m_new)

        v = 0.5 * r * (sliding_motor + dq)
        phi = phi0
        if on[stribeck_friction.ON]:
            phi *= stribeck_friction.friction_factor(p, v)
        stretch = r * (pulley - q) + x[IN_PUSH_STRETCH]
        ta = max(0.0, p[PRETENSION] + k * stretch)
        tb = max(0.0, p[PRETENSION] - k * stretch)
        da = math.exp(-0.5 * phi * za)
        db = math.exp(-0.5 * phi * zb)
        way = 1.0 if v > 0.0 else -1.0
        moment = r * (ta * da - tb * db) + x[IN_PUSH_MOMENT]
        moment -= p[JOINT_STIFFNESS] * q + p[JOINT_FRICTION] * zj
        slope = p[JOINT_STIFFNESS]
        slope += r * r * k * ((da if ta > 0.0 else 0.0) + (db if tb > 0.0 else 0.0))
        grip = 0.25 * r * r * phi / xs
        slope += grip * (ta * da * (1.0 - za * way) + tb * db * (1.0 + zb * way))
        way_joint = 1.0 if dq > 0.0 else -1.0
        slope += p[JOINT_FRICTION] / p[JOINT_PRESLIDING] * (1.0 - zj * way_joint)
        if on[joint_stop.ON]:
            stop_moment, stop_slope = joint_stop.moment_and_slope(p, q)
            moment += stop_moment
            slope += stop_slope
        # The half step of sliding that the motor alone causes; the joint's share is in `slope`.
        moment -= (grip * dt * sliding_motor * 0.5
                   * (ta * da * (1.0 - za * way) + tb * db * (1.0 + zb * way)))
        dq = moment / (p[JOINT_DAMPING] + 0.5 * dt * slope)

        slid = 0.5 * r * (sliding_motor + dq) * dt / xs
        za = presliding_step(za, slid)
        zb = presliding_step(zb, -slid)
        zj = presliding_step(zj, dq * dt / p[JOINT_PRESLIDING])
        q += dq * dt
        m, dm = m_new, dm_new
    state[MOTOR], state[MOTOR_SPEED], state[JOINT], state[JOINT_SPEED] = m, dm, q, dq
    state[SLIDE_A], state[SLIDE_B], state[JOINT_SLIDE] = za, zb, zj
    state[PULLEY] = m
    phi = phi0
    if on[stribeck_friction.ON]:
        phi *= stribeck_friction.friction_factor(p, 0.5 * r * (dm + dq))
    stretch = r * (m - q) + x[IN_PUSH_STRETCH]
    state[TENSION_A] = max(0.0, p[PRETENSION] + k * stretch) * math.exp(0.5 * phi * za)
    state[TENSION_B] = max(0.0, p[PRETENSION] - k * stretch) * math.exp(0.5 * phi * zb)
    state[TICKS] += 1.0


@njit(cache=True)
def read_sensors(state, history, p, on, tick, out):
    """Write what the noise-free sensors read now into `out` (OUTPUTS,); once a tick."""
    history[ANGLE_HISTORY, int(state[TICKS]) % HISTORY] = state[JOINT]
    out[OUT_MOTOR] = state[MOTOR]
    out[OUT_MOTOR_SPEED] = state[MOTOR_SPEED]
    out[OUT_EFFORT] = p[PULLEY_RADIUS] * (state[TENSION_A] - state[TENSION_B])
    out[OUT_TENSION_A] = state[TENSION_A]
    out[OUT_TENSION_B] = state[TENSION_B]
    out[OUT_BENDING] = state[JOINT]
    out[OUT_JOINT] = state[JOINT]


@njit(cache=True)
def run_joints(states, histories, p, on, inputs, coupled, tick, substeps, out):
    """Run all joints side by side over a whole input.

    Parameters
    ----------
    states : array (J, states), histories : array (J, 2, HISTORY)
        Changed in place.
    p : array (J, parameters), on : array (J, flags)
    inputs : array (J, N, INPUTS)
    coupled : bool
        Whether each joint sees the other's angle of the tick before, instead of the input's.
    tick : float
    substeps : int
    out : array (J, N, OUTPUTS)
        Row k is what the sensors read at tick k, before command k acts.
    """
    joints, ticks = inputs.shape[0], inputs.shape[1]
    x = inputs[0, 0].copy()
    for n in range(ticks):
        for j in range(joints):
            read_sensors(states[j], histories[j], p[j], on[j], tick, out[j, n])
        for j in range(joints):
            x[:] = inputs[j, n]
            if coupled and joints > 1:
                x[IN_OTHER_JOINT] = out[1 - j, n, OUT_JOINT] if j < 2 else 0.0
            advance_tick(states[j], histories[j], p[j], on[j], x[IN_COMMAND], x, tick, substeps)

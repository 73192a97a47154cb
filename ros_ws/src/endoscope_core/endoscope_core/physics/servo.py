"""The motor: the servo's position loop, and where it yields to the torque of the wires.

The symbols are those of the plant's equations: shaft angle m, command u, both in rad.
"""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.physics import hooks
from endoscope_core.physics.folds import acting, folded
from endoscope_core.physics.layout import (
    FLOOR,
    IN_COMMAND,
    IN_MOTOR,
    MOTOR,
    MOTOR_SPEED,
    PULLEY_RADIUS,
    TRANSITION,
    WIRE_A,
    WIRE_B,
    WIRE_STIFFNESS,
)
from endoscope_core.physics.sheath import MOTOR_END, moved

command_at_servo = folded(hooks.COMMAND)
servo_error = folded(hooks.SERVO_ERROR)
largest_torque, torque_is_limited = folded(hooks.TORQUE), acting(hooks.TORQUE)

_TRIES = 40
_TORQUE_PRECISION = 1e-11
"""N m."""


@compiled
def transition(
    bandwidth: float, damping_ratio: float, step: float
) -> tuple[float, float, float, float]:
    """Exact transition of the servo over `step` s: rows of the matrix on (m - u, m').

    `bandwidth` in rad/s.
    """
    # m'' = wm^2 (u - m) - 2 zeta wm m': Ogata, Modern Control Engineering, 5th ed. 2010, sec. 5-3.
    sigma = damping_ratio * bandwidth
    discriminant = damping_ratio * damping_ratio - 1.0
    if discriminant < -1e-9:
        w = bandwidth * math.sqrt(-discriminant)
        decay = math.exp(-sigma * step)
        c, s = decay * math.cos(w * step), decay * math.sin(w * step) / w
    elif discriminant > 1e-9:
        w = bandwidth * math.sqrt(discriminant)
        # sigma - w without the difference of two large numbers.
        slow = math.exp(-bandwidth * bandwidth / (sigma + w) * step)
        fast = math.exp(-(sigma + w) * step)
        c, s = 0.5 * (slow + fast), 0.5 * (slow - fast) / w
    else:
        decay = math.exp(-sigma * step)
        c, s = decay, decay * step
    return c + sigma * s, s, -bandwidth * bandwidth * s, c - sigma * s


@compiled
def turn_motor(
    x: Array, history: Array, table: Array, p: Array, on: Flags, inputs: Array, tick: float
) -> None:
    """Turn the motor for a tick: after its command, or to where it was measured."""
    if math.isnan(inputs[IN_MOTOR]):
        u = command_at_servo(on, p, x, inputs[IN_COMMAND], history, tick)
        from_error, kept = x[TRANSITION + 2], x[TRANSITION + 3]
        error = servo_error(on, p, x, x[MOTOR] - u, from_error, kept)
        # With an error of its own, the servo goes to where that error sends it.
        u = x[MOTOR] - error
        speed = from_error * error + kept * x[MOTOR_SPEED]
        m = u + x[TRANSITION] * error + x[TRANSITION + 1] * x[MOTOR_SPEED]
        if torque_is_limited(on):
            dm = _yielding_step(x, table, p, on, m - x[MOTOR], tick)
            if dm != m - x[MOTOR]:
                m, speed = x[MOTOR] + dm, dm / tick
    else:
        m = inputs[IN_MOTOR]
        speed = (m - x[MOTOR]) / tick
    x[MOTOR], x[MOTOR_SPEED] = m, speed


@compiled
def _torque(x: Array, table: Array, p: Array, dm: float) -> float:
    """Torque of the wires on the pulley in N m once it has turned by `dm` rad."""
    # Effort at the shaft: pulley_radius (Ta(0) - Tb(0)).
    r = p[PULLEY_RADIUS]
    kw = p[WIRE_STIFFNESS] * r * dm
    t_a, _, _, _, _, _ = moved(x, WIRE_A, table, MOTOR_END, kw, x[FLOOR])
    t_b, _, _, _, _, _ = moved(x, WIRE_B, table, MOTOR_END, -kw, x[FLOOR])
    return r * (t_a - t_b)


@compiled
def _overload(
    x: Array, table: Array, p: Array, on: Flags, dm: float, sign: float, tick: float
) -> float:
    """Torque in N m by which the wires load the motor with more than it can bear."""
    load = sign * _torque(x, table, p, dm)
    return load - largest_torque(on, p, x, sign * dm / tick)


@compiled
def _yielding_step(x: Array, table: Array, p: Array, on: Flags, dm: float, tick: float) -> float:
    """Step of the motor in rad, cut where the wires load it with more than it can bear."""
    # The load grows with the step, and what is bearable falls with the speed of a motor that drives
    # its load: one step divides them, which a bracketed secant finds (Dowell, Jarratt, BIT 11,
    # 1971).
    load = _torque(x, table, p, dm)
    sign = 1.0 if load > 0.0 else -1.0
    far, far_excess = dm, abs(load) - largest_torque(on, p, x, sign * dm / tick)
    if far_excess <= 0.0:
        return dm
    back = max(1e-4, abs(dm))
    near = min(0.0, sign * dm) * sign
    near_excess = _overload(x, table, p, on, near, sign, tick)
    for _ in range(_TRIES):
        if near_excess <= 0.0:
            break
        far, far_excess = near, near_excess
        near -= sign * back
        back *= 2.0
        near_excess = _overload(x, table, p, on, near, sign, tick)
    for _ in range(_TRIES):
        if abs(far_excess) <= _TORQUE_PRECISION or far_excess == near_excess:
            break
        found = far - far_excess * (far - near) / (far_excess - near_excess)
        excess = _overload(x, table, p, on, found, sign, tick)
        if excess * far_excess > 0.0:
            near_excess *= max(0.5, 1.0 - excess / far_excess)
        else:
            near, near_excess = far, far_excess
        far, far_excess = found, excess
    return far

"""Compiled physics of the actuator: from the command to the pulley."""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import (
    actuator_lag,
    cogging,
    gear_backlash,
    rate_limit,
    transport_delay,
)


@compiled
def servo_transition(
    bandwidth: float,
    damping_ratio: float,
    step: float,
) -> tuple[float, float, float, float]:
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
    return (
        decay * (c + sigma * s),
        decay * s,
        -decay * bandwidth * bandwidth * s,
        decay * (c - sigma * s),
    )


@compiled
def servo_command(
    state: Array,
    history: Array,
    p: Array,
    on: Flags,
    u: float,
    fraction: float,
    width: float,
    tick: float,
) -> float:
    """Mean command that reaches the servo in a substep from `fraction`, `width` ticks long."""
    command = u
    if on[transport_delay.ON]:
        command = transport_delay.delayed_command(state, p, history, fraction, width, tick)
    if on[actuator_lag.ON]:
        command = actuator_lag.lagged_command(state, p, command, width * tick)
    if on[rate_limit.ON] and p[rate_limit.OF_COMMAND] > 0.5:
        command = rate_limit.slewed_command(state, p, command, width * tick)
    return command


@compiled
def servo_step(
    p: Array,
    on: Flags,
    transition: tuple[float, float, float, float],
    m: float,
    dm: float,
    command: float,
) -> tuple[float, float]:
    """Motor angle and speed after a substep with `command` held."""
    a11, a12, a21, a22 = transition
    error = m - command
    if on[rate_limit.ON] and p[rate_limit.OF_COMMAND] < 0.5:
        error = rate_limit.limited_error(p, error, a21, a22)
        command = m - error
    return command + a11 * error + a12 * dm, a21 * error + a22 * dm


@compiled
def pulley_angle(state: Array, p: Array, on: Flags, m: float) -> float:
    """Pulley's angle, joint-equivalent, once the motor has moved to `m`."""
    pulley = m
    if on[gear_backlash.ON]:
        pulley = gear_backlash.behind_play(state, p, m)
    if on[cogging.ON]:
        pulley += cogging.ripple(p, m)
    return pulley

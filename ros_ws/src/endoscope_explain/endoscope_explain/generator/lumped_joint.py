"""One joint with lumped sheath friction, by the classical fourth-order Runge-Kutta scheme."""

import math
from typing import Any

import numpy as np

from endoscope_explain.generator.compiled_physics import compiled
from endoscope_explain.generator.wire_and_joint_laws import (
    crimp_slip,
    dead_zone,
    joint_friction,
    joint_moment,
    joint_resistance,
    presliding_distance,
    sheath_factor,
    viscous_force,
    wire_tension,
)

# Parallel slip elements for friction with memory: share of the force, and slip distance in units
# of the pre-sliding distance.
SHARE = np.array([0.30, 0.30, 0.25, 0.15])
REACH = np.array([0.30, 0.80, 1.80, 4.00])
ELEMENTS = 4
SLIP_SHARPNESS = 6.0

# State vector of a joint. With play in the joint DRUM is the wire's end and TIP the tip; without,
# they move together.
DRUM, RATE, TIP, ZA, ZB, ZJ = 0, 1, 2, 3, 7, 11
CREEP_A1, CREEP_A2, CREEP_B1, CREEP_B2 = 15, 16, 17, 18
SLID, SLIP_SPEED, AGE, RELAXED = 19, 20, 21, 22
STATES = 23
FRICTION_LAG = 0.003
FLANK_STIFFNESS = 0.5
DRUM_SHARE_OF_DAMPING = 0.3


@compiled
def _mean_z(y: Any, first: int, slip_elements: float) -> float:
    if slip_elements == 0.0:
        return float(y[first])
    total = 0.0
    for i in range(ELEMENTS):
        total += SHARE[i] * y[first + i]
    return total


@compiled
def _friction_rates(
    y: Any,
    rates: Any,
    first: int,
    velocity: float,
    distance: float,
    power: float,
    slip_elements: float,
) -> None:
    direction = 1.0 if velocity >= 0.0 else -1.0
    if slip_elements == 0.0:
        left = max(0.0, 1.0 - direction * y[first])
        if power != 1.0:
            left = left**power
        rates[first] = velocity / distance * left
        return
    for i in range(ELEMENTS):
        z = y[first + i]
        left = max(0.0, 1.0 - direction * math.copysign(abs(z) ** SLIP_SHARPNESS, z))
        rates[first + i] = velocity / (distance * REACH[i]) * left


@compiled
def joint_rates(
    y: Any,
    rates: Any,
    readings: Any,
    wire_in: float,
    wire_speed: float,
    other: float,
    time: float,
    rig: Any,
) -> None:
    """Time derivative of the joint's state.

    Parameters
    ----------
    y, rates
        State and (output) its derivative, shape (STATES,).
    readings
        Output, shape (2,): tension (N) of the positive and the negative wire at the load cells.
    wire_in, wire_speed
        Length (m) and speed (m/s) that the pulley has wound of the positive wire.
    other
        Bending (rad) of the other joint.
    time
        Seconds from the start.
    rig
        The joint's record.
    """
    radius = rig.joint_radius
    drum = y[DRUM]
    tip = y[TIP] if rig.flank_gap > 0.0 else drum
    za = _mean_z(y, ZA, rig.sheath_slip_elements)
    zb = _mean_z(y, ZB, rig.sheath_slip_elements)
    zj = _mean_z(y, ZJ, rig.joint_slip_elements)
    stretch = wire_in - radius * drum
    ta = wire_tension(stretch - y[CREEP_A1] - y[CREEP_A2] - crimp_slip(time, rig), time, rig)
    tb = wire_tension(-stretch - y[CREEP_B1] - y[CREEP_B2], time, rig)
    position = 0.5 * (wire_in + radius * drum)
    pa = (
        0.5
        * rig.capstan_exponent
        * za
        * sheath_factor(za, y[SLIP_SPEED], y[SLID], position, y[AGE], tip, other, time, rig)
    )
    pb = (
        0.5
        * rig.capstan_exponent
        * zb
        * sheath_factor(zb, y[SLIP_SPEED], y[SLID], position, y[AGE], tip, other, time, rig)
    )
    ga = math.exp(pa)
    gb = math.exp(pb)
    pull = radius * (ta / ga - tb / gb)
    resist = joint_resistance(tip, rig)
    load = joint_moment(tip, y[RELAXED], other, time, rig) - joint_friction(tip, rig) * zj

    if rig.flank_gap > 0.0:
        flank = FLANK_STIFFNESS * dead_zone(drum - tip, 0.5 * rig.flank_gap)
        tip_rate = (flank + load) / resist
        free, damping = pull - flank, DRUM_SHARE_OF_DAMPING * rig.joint_damping
        rates[TIP] = tip_rate
    else:
        free, damping, tip_rate = pull + load, resist, 0.0
        rates[TIP] = 0.0

    if rig.inertia > 0.0:
        drum_rate = y[RATE]
        drag = viscous_force(0.5 * (wire_speed + radius * drum_rate), rig)
        rates[RATE] = (free - radius * drag - damping * drum_rate) / rig.inertia
    else:
        drum_rate = free / damping
        drag = 0.0
        if rig.viscous > 0.0:
            drum_rate = y[RATE]
            slope = damping + 0.5 * rig.viscous * radius * radius
            for _ in range(6):
                drag = viscous_force(0.5 * (wire_speed + radius * drum_rate), rig)
                drum_rate -= (damping * drum_rate + radius * drag - free) / slope
        rates[RATE] = 0.0
    rates[DRUM] = drum_rate
    if rig.flank_gap <= 0.0:
        tip_rate = drum_rate

    slip = 0.5 * (wire_speed + radius * drum_rate)
    distance_a = presliding_distance(ta, rig)
    distance_b = presliding_distance(tb, rig)
    _friction_rates(y, rates, ZA, slip, distance_a, rig.sheath_power, rig.sheath_slip_elements)
    _friction_rates(y, rates, ZB, -slip, distance_b, rig.sheath_power, rig.sheath_slip_elements)
    _friction_rates(
        y, rates, ZJ, tip_rate, rig.joint_presliding, rig.joint_power, rig.joint_slip_elements
    )
    slow_rates(y, rates, ta, tb, slip, tip, rig)
    readings[0] = max(0.0, ta * ga + 0.5 * drag)
    readings[1] = max(0.0, tb * gb - 0.5 * drag)


@compiled
def slow_rates(y: Any, rates: Any, ta: float, tb: float, slip: float, tip: float, rig: Any) -> None:
    """Derivatives of creep, slid distance, lagging speed, contact age and relaxed angle."""
    if rig.creep_compliance_1 > 0.0:
        a, b = ta - rig.pretension, tb - rig.pretension
        rates[CREEP_A1] = (rig.creep_compliance_1 * a - y[CREEP_A1]) / rig.creep_time_1
        rates[CREEP_A2] = (rig.creep_compliance_2 * a - y[CREEP_A2]) / rig.creep_time_2
        rates[CREEP_B1] = (rig.creep_compliance_1 * b - y[CREEP_B1]) / rig.creep_time_1
        rates[CREEP_B2] = (rig.creep_compliance_2 * b - y[CREEP_B2]) / rig.creep_time_2
    rates[SLID] = abs(slip)
    rates[SLIP_SPEED] = (abs(slip) - y[SLIP_SPEED]) / FRICTION_LAG
    if rig.ageing > 0.0:
        rates[AGE] = 1.0 - abs(slip) * y[AGE] / rig.ageing_distance
    if rig.relaxing_stiffness > 0.0:
        rates[RELAXED] = (tip - y[RELAXED]) / rig.relaxing_time


@compiled
def advance_lumped(
    y: Any,
    work: Any,
    readings: Any,
    wire_in: float,
    wire_speed: float,
    other: float,
    time: float,
    step: float,
    rig: Any,
) -> None:
    """Advance the state by one step while the wire is wound at constant speed.

    Parameters
    ----------
    y
        State, shape (STATES,), changed in place.
    work
        Scratch, shape (5, STATES).
    readings
        Scratch and output, shape (2,), see `joint_rates`.
    wire_in
        Wound length (m) at the start of the step.
    wire_speed
        Speed (m/s) during the step.
    other
        Bending (rad) of the other joint.
    time, step
        Start and length of the step in seconds.
    rig
        The joint's record.
    """
    k1, k2, k3, k4, middle = work[0], work[1], work[2], work[3], work[4]
    half = 0.5 * step
    joint_rates(y, k1, readings, wire_in, wire_speed, other, time, rig)
    for i in range(STATES):
        middle[i] = y[i] + half * k1[i]
    at_middle = wire_in + half * wire_speed
    joint_rates(middle, k2, readings, at_middle, wire_speed, other, time + half, rig)
    for i in range(STATES):
        middle[i] = y[i] + half * k2[i]
    joint_rates(middle, k3, readings, at_middle, wire_speed, other, time + half, rig)
    for i in range(STATES):
        middle[i] = y[i] + step * k3[i]
    at_end = wire_in + step * wire_speed
    joint_rates(middle, k4, readings, at_end, wire_speed, other, time + step, rig)
    for i in range(STATES):
        y[i] += step / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i])

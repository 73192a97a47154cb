"""Static laws of wire, sheath and joint in the generator's own functional forms.

`rig` is one record of `endoscope_explain.generator.rig.RIG_TYPE`; SI units throughout. Sources of
the forms stand beside the draws, in the `conceal_*` files.
"""

import math
from typing import Any

from endoscope_explain.generator.compiled_physics import compiled


@compiled
def wire_tension(stretch: float, time: float, rig: Any) -> float:
    """Tension (N) of a wire stretched by `stretch` (m) beyond its pretension."""
    if rig.dead_zone > 0.0:
        stretch -= rig.dead_zone * math.tanh(stretch / rig.dead_zone)
    if rig.missing_length > 0.0:
        stretch -= rig.missing_length
    stiffness = rig.wire_stiffness
    if rig.softening > 0.0:
        stiffness *= 1.0 - rig.softening * (1.0 - math.exp(-time / rig.softening_time))
    force = stiffness * stretch
    if rig.toe_exponent > 0.0:
        force = stiffness * math.expm1(rig.toe_exponent * stretch) / rig.toe_exponent
    pretension = rig.pretension
    if rig.loss > 0.0:
        pretension -= rig.loss * (1.0 - math.exp(-time / rig.loss_time))
    return max(0.0, pretension + force)


@compiled
def crimp_slip(time: float, rig: Any) -> float:
    """Length (m) by which the positive wire has slipped through its crimp until now."""
    length = 0.0
    if rig.crimp_slip != 0.0:
        for moment in (rig.crimp_time_1, rig.crimp_time_2, rig.crimp_time_3):
            if time >= moment:
                length += rig.crimp_slip
    return length


@compiled
def sheath_factor(
    z: float,
    speed: float,
    slid: float,
    position: float,
    age: float,
    bending: float,
    other_bending: float,
    time: float,
    rig: Any,
) -> float:
    """Factor on the capstan exponent of one wire.

    `z` is its pre-sliding state (positive while it is pulled), `speed` its lagging sliding speed
    (m/s), `slid` the distance slid (m), `position` the wire's position (m), `age` the age of the
    contact (s).
    """
    factor = 1.0
    if rig.exponent_jump != 0.0:
        x = (time - rig.jump_time) / rig.jump_width
        factor *= 1.0 + rig.exponent_jump * 0.5 * (1.0 + math.tanh(x))
    if rig.stribeck_rise != 0.0:
        factor *= 1.0 + rig.stribeck_rise / (1.0 + (speed / rig.stribeck_speed) ** 2)
    if rig.pull_release != 0.0:
        factor *= 1.0 + rig.pull_release * z
    if rig.run_in_drop != 0.0:
        factor *= 1.0 - rig.run_in_drop * slid / (slid + rig.run_in_distance)
    if rig.ageing != 0.0:
        factor *= 1.0 + rig.ageing * math.log1p(age / rig.ageing_time)
    if rig.ripple != 0.0:
        turn = 2.0 * math.pi * position / rig.ripple_length
        factor *= 1.0 + rig.ripple * math.sin(turn + rig.ripple_phase)
    if rig.wrap_own != 0.0:
        factor *= 1.0 + rig.wrap_own * abs(bending)
    if rig.wrap_other != 0.0:
        factor *= 1.0 + rig.wrap_other * other_bending * other_bending
    return max(0.0, factor)


@compiled
def presliding_distance(tension: float, rig: Any) -> float:
    """Pre-sliding distance (m) of a wire under `tension` (N)."""
    if rig.tension_presliding == 0.0:
        return float(rig.presliding_distance)
    ratio = max(tension, 0.2 * rig.pretension) / rig.pretension
    return float(rig.presliding_distance * ratio**rig.tension_presliding)


@compiled
def viscous_force(velocity: float, rig: Any) -> float:
    """Drag (N) of the whole sheath on one wire, slightly shear-thinning below a power of one."""
    reference = 0.005
    speed = velocity / reference
    thinning = (1.0 + speed * speed) ** (0.5 * (rig.viscous_power - 1.0))
    return float(rig.viscous * velocity * thinning)


@compiled
def joint_moment(
    bending: float, relaxed: float, other_bending: float, time: float, rig: Any
) -> float:
    """Moment (N m) on the tip from all but wires, friction and damping."""
    moment = -rig.joint_stiffness * bending
    if rig.stiffness_square != 0.0 or rig.stiffness_cube != 0.0:
        moment -= rig.stiffness_square * bending * bending + rig.stiffness_cube * bending**3
    if rig.relaxing_stiffness != 0.0:
        moment -= rig.relaxing_stiffness * (bending - relaxed)
    if rig.stop_stiffness != 0.0:
        depth = abs(bending) - rig.stop_angle
        if depth > 0.0:
            moment -= math.copysign(rig.stop_stiffness * depth, bending)
    if rig.contact_stiffness != 0.0:
        depth = rig.contact_side * (bending - rig.contact_angle)
        if depth > 0.0:
            moment -= rig.contact_side * rig.contact_stiffness * depth**rig.contact_power
    if rig.gravity_moment != 0.0:
        moment += rig.gravity_moment * math.sin(bending + rig.gravity_phase)
    if rig.load_moment != 0.0:
        ramp = min(1.0, max(0.0, (time - rig.load_time) / rig.load_ramp))
        moment += rig.load_moment * ramp * ramp * (3.0 - 2.0 * ramp)
    if rig.breathing_moment != 0.0:
        turn = math.pi * rig.breathing_frequency * time + rig.breathing_phase
        moment += rig.breathing_moment * (math.cos(turn) ** 4 - 0.375)
    if rig.coupling != 0.0:
        moment += other_bending * (rig.coupling + rig.coupling_square * other_bending)
    if rig.bump_moment != 0.0:
        x = (bending - rig.bump_angle) / rig.bump_width
        moment += rig.bump_moment * math.exp(-x * x)
    if rig.periodic_moment != 0.0:
        moment += rig.periodic_moment * math.sin(rig.periodic_number * bending + rig.periodic_phase)
    return float(moment)


@compiled
def joint_resistance(bending: float, rig: Any) -> float:
    """Coefficient (N m s/rad) of the moments proportional to the joint's speed."""
    damping = rig.joint_damping
    if rig.stop_stiffness != 0.0:
        depth = abs(bending) - rig.stop_angle
        if depth > 0.0:
            damping += rig.stop_loss * rig.stop_stiffness * depth
    if rig.contact_stiffness != 0.0:
        depth = rig.contact_side * (bending - rig.contact_angle)
        if depth > 0.0:
            damping += rig.contact_loss * rig.contact_stiffness * depth**rig.contact_power
    return float(damping)


@compiled
def joint_friction(bending: float, rig: Any) -> float:
    """Sliding friction (N m) of the joint at this angle."""
    return float(rig.joint_friction * (1.0 + rig.friction_of_angle * bending * bending))


@compiled
def dead_zone(x: float, half_width: float) -> float:
    """What of `x` exceeds a play of `half_width` to either side."""
    if x > half_width:
        return x - half_width
    if x < -half_width:
        return x + half_width
    return 0.0

"""Compiled physics of wires and sheath."""

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import (
    configuration_change,
    distributed_friction,
    friction_asymmetry,
    friction_run_in,
    pretension_loss,
    stribeck_friction,
    viscous_friction,
    wire_slack,
    wire_stiffening,
)
from endoscope_core.effects.slots import CAPSTAN_EXPONENT, PRETENSION, WIRE_STIFFNESS


@compiled
def pretension_now(p: Array, on: Flags, time: float) -> float:
    """Pretension in N at `time`."""
    if on[pretension_loss.ON]:
        return pretension_loss.left(p, p[PRETENSION], time)
    return p[PRETENSION]


@compiled
def wire_tension(p: Array, on: Flags, pretension: float, stretch: float) -> tuple[float, float]:
    """Tension in N of a wire at a stretch in m, and its slope in N/m."""
    slope = p[WIRE_STIFFNESS]
    if on[wire_slack.ON]:
        stretch, growth = wire_slack.taut_stretch(p, stretch)
        slope *= growth
    if on[wire_stiffening.ON]:
        stretch, growth = wire_stiffening.linear_equivalent(p, stretch)
        slope *= growth
    tension = pretension + p[WIRE_STIFFNESS] * stretch
    if tension <= 0.0:
        return 0.0, 0.0
    return tension, slope


@compiled
def friction_exponent(
    state: Array,
    p: Array,
    on: Flags,
    speed: float,
    ahead: float,
    time: float,
    tick: float,
) -> tuple[float, float]:
    """Capstan exponent of the whole sheath, as the mean over the tick around `time`; and shudder.

    Sliding speed and the wires' shudder are in m/s. The states are those of `ahead` s earlier.
    """
    phi = p[CAPSTAN_EXPONENT]
    shudder = 0.0
    if on[stribeck_friction.ON]:
        factor, shudder = stribeck_friction.factor_and_shudder(state, p, speed, ahead)
        phi *= factor
    if on[friction_run_in.ON]:
        phi *= friction_run_in.friction_factor(state, p)
    if on[configuration_change.ON]:
        phi *= configuration_change.friction_factor(p, time, tick)
    return phi, shudder


@compiled
def half_exponent(
    p: Array,
    on: Flags,
    phi: float,
    slide: float,
    speed: float,
) -> tuple[float, float]:
    """Exponent of the friction at one end of a wire, and its slope by the pre-sliding state.

    `speed` is that of this wire towards the motor in m/s.
    """
    slope = 0.5 * phi
    if on[friction_asymmetry.ON]:
        slope *= friction_asymmetry.friction_factor(p, slide)
    exponent = slope * slide
    if on[viscous_friction.ON]:
        exponent += 0.5 * viscous_friction.exponent(p, speed)
    return exponent, slope


@compiled
def is_distributed(p: Array, on: Flags) -> bool:
    """Whether a share of the sheath's friction acts along it, on a chain of nodes."""
    return on[distributed_friction.ON] and p[distributed_friction.SHARE] > 0.0

"""States of the plant that functions at places depend on, from what their hooks are given."""

from endoscope_core.compiled import Array, compiled
from endoscope_core.physics.layout import (
    JOINT,
    LAGGED_ANGLE,
    LAGGED_LOAD,
    LAGGED_SPEED,
    MEAN_TENSION,
    NOW,
    OTHER,
    PATH,
    REST_TENSION,
    TENSION_DIFFERENCE,
)


@compiled
def own_angle(x: Array) -> float:
    return x[JOINT]


@compiled
def other_angle(x: Array) -> float:
    return x[OTHER]


@compiled
def both_tensions(x: Array) -> float:
    return x[MEAN_TENSION]


@compiled
def tension_difference(x: Array) -> float:
    return x[TENSION_DIFFERENCE]


@compiled
def path(x: Array) -> float:
    return x[PATH]


@compiled
def now(x: Array) -> float:
    return x[NOW]


@compiled
def lagged_speed(x: Array) -> float:
    return x[LAGGED_SPEED]


@compiled
def lagged_tension(x: Array, wire: int) -> float:
    return x[LAGGED_LOAD + wire] - x[REST_TENSION]


@compiled
def angle_less_lagged(x: Array, angle: float) -> float:
    return angle - x[LAGGED_ANGLE]


@compiled
def angular_speed(step: float, tick: float) -> float:
    return step / tick


@compiled
def per_tick(tick: float) -> float:
    return 1.0 / tick


@compiled
def unit_slope() -> float:
    return 1.0


@compiled
def opposite(wire: int) -> float:
    return 1.0 - 2.0 * wire

"""Compiled pre-sliding friction of a wire or of the joint: Dahl's, or of another shape."""

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import dahl, presliding_shape


@compiled
def steepness(
    state: Array,
    p: Array,
    on: Flags,
    place: int,
    slide: float,
    speed: float,
    shudder: float,
) -> float:
    """Growth of a friction state by displacement in pre-sliding distances, in a speed's way."""
    way = 1.0 if speed > 0.0 else -1.0
    if shudder > 0.0:
        way = speed / dahl.path_length(speed, shudder)
    if presliding_shape.acts(p, on, place):
        return presliding_shape.steepness(state, p, place, way)
    return 1.0 - slide * way


@compiled
def slid(
    state: Array,
    p: Array,
    on: Flags,
    place: int,
    slide: float,
    ratio: float,
    shake: float,
) -> float:
    """Friction state after sliding `ratio` pre-sliding distances (signed)."""
    if presliding_shape.acts(p, on, place):
        return presliding_shape.slid(state, p, place, ratio)
    return dahl.slid(slide, ratio, shake)

"""What the noise-free sensors of one joint read."""

import math

from endoscope_core.compiled import Array, Flags, compiled
from endoscope_core.effects import (
    load_cell_crosstalk,
    load_cell_drift,
    load_cell_gain,
    load_cell_saturation,
    tracker_bias,
    tracker_delay,
    tracker_distortion,
    tracker_drift,
)
from endoscope_core.effects.slots import (
    ANGLE_HISTORY,
    CAPSTAN_EXPONENT,
    HISTORY,
    MOTOR,
    MOTOR_SPEED,
    PULLEY_RADIUS,
    SLIDE_A,
    SLIDE_B,
    TENSION_A,
    TENSION_B,
    TICKS,
    TIP,
)
from endoscope_core.plant.inputs import (
    OUT_BENDING,
    OUT_EFFORT,
    OUT_JOINT,
    OUT_MOTOR,
    OUT_MOTOR_SPEED,
    OUT_TENSION_A,
    OUT_TENSION_B,
)
from endoscope_core.plant.transmission import (
    half_exponent,
    is_distributed,
    pretension_now,
    wire_tension,
)


@compiled
def tracker_reading(state: Array, history: Array, p: Array, on: Flags, tick: float) -> float:
    """Bending angle in rad as the tracker reads it now."""
    angle = state[TIP]
    if on[tracker_delay.ON]:
        angle = tracker_delay.reading(state, p, history, tick)
    if on[tracker_distortion.ON]:
        angle = tracker_distortion.reading(p, angle)
    if on[tracker_drift.ON]:
        angle = tracker_drift.reading(p, angle, state[TICKS] * tick)
    if on[tracker_bias.ON]:
        angle = tracker_bias.reading(p, angle)
    return angle


@compiled
def is_cell(p: Array, choice: int, cell: int) -> bool:
    """Whether the parameter at index `choice` names the load cell 0 (pos) or 1 (neg)."""
    return (p[choice] > 0.5) == (cell == 1)


@compiled
def load_cell_reading(
    p: Array,
    on: Flags,
    cell: int,
    tension: float,
    neighbour: float,
    time: float,
) -> float:
    """Tension in N as a load cell reads it, with `neighbour` N on the other one of the pair."""
    if on[load_cell_crosstalk.ON] and is_cell(p, load_cell_crosstalk.WIRE, cell):
        tension = load_cell_crosstalk.reading(p, tension, neighbour)
    if on[load_cell_gain.ON] and is_cell(p, load_cell_gain.WIRE, cell):
        tension = load_cell_gain.reading(p, tension)
    if on[load_cell_drift.ON] and is_cell(p, load_cell_drift.WIRE, cell):
        tension = load_cell_drift.reading(p, tension, time)
    if on[load_cell_saturation.ON] and is_cell(p, load_cell_saturation.WIRE, cell):
        tension = load_cell_saturation.reading(p, tension)
    return tension


@compiled
def read_sensors(
    state: Array,
    history: Array,
    p: Array,
    on: Flags,
    tick: float,
    out: Array,
) -> None:
    """Write what the noise-free sensors read now into `out` (OUTPUTS,); once a tick."""
    history[ANGLE_HISTORY, int(state[TICKS]) % HISTORY] = state[TIP]
    if state[TICKS] == 0.0:
        rest, _ = wire_tension(p, on, pretension_now(p, on, 0.0), 0.0)
        state[TENSION_A] = state[TENSION_B] = rest
        if not is_distributed(p, on):
            for tension, slide in ((TENSION_A, SLIDE_A), (TENSION_B, SLIDE_B)):
                held, _ = half_exponent(p, on, p[CAPSTAN_EXPONENT], state[slide], 0.0)
                state[tension] *= math.exp(held)
    ta, tb = state[TENSION_A], state[TENSION_B]
    time = state[TICKS] * tick
    out[OUT_MOTOR] = state[MOTOR]
    out[OUT_MOTOR_SPEED] = state[MOTOR_SPEED]
    out[OUT_EFFORT] = p[PULLEY_RADIUS] * (ta - tb)
    out[OUT_TENSION_A] = load_cell_reading(p, on, 0, ta, tb, time)
    out[OUT_TENSION_B] = load_cell_reading(p, on, 1, tb, ta, time)
    out[OUT_BENDING] = tracker_reading(state, history, p, on, tick)
    out[OUT_JOINT] = state[TIP]

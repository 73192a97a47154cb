"""Servo, gear and pulley of the concealed rig: exact for a command held over the step."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import expm

from endoscope_explain.generator.compiled_physics import compiled

# State of one servo: angle and speed of the shaft, lagging command, slewed command, and the
# positions of the two flanks whose mean is the pulley's side of the gear.
ANGLE, SPEED, LAGGING, SLEWED, FLANK_1, FLANK_2 = range(6)
SERVO_STATES = 6
FLANK_SPREAD = 0.15
STALL_KNEE = 0.85
STALL_SPEED = 8.0


def servo_transition(
    bandwidth: float, damping_ratio: float, step: float
) -> npt.NDArray[np.float64]:
    """Exact transition of shaft angle and speed over `step` seconds, shape (2, 3).

    Columns act on angle, speed and the held command (zero-order hold by the matrix exponential;
    Van Loan 1978, IEEE Trans. Automatic Control 23(3)).
    """
    system = np.zeros((3, 3))
    system[0, 1] = 1.0
    system[1] = (-(bandwidth**2), -2.0 * damping_ratio * bandwidth, bandwidth**2)
    return np.ascontiguousarray(expm(system * step)[:2])


@compiled
def advance_servo(
    s: Any, transition: Any, command: float, torque: float, step: float, rig: Any
) -> None:
    """Advance one servo by a step.

    `s` is its state (SERVO_STATES,), changed in place; `command` (rad) is held; `torque` (N m) is
    what the wires exert against positive rotation.
    """
    if rig.servo_lag > 0.0:
        s[LAGGING] = command + (s[LAGGING] - command) * math.exp(-step / rig.servo_lag)
        command = s[LAGGING]
    if rig.command_slew > 0.0:
        most = rig.command_slew * step
        s[SLEWED] += min(most, max(-most, command - s[SLEWED]))
        command = s[SLEWED]
    angle, speed = s[ANGLE], s[SPEED]
    new_angle = transition[0, 0] * angle + transition[0, 1] * speed + transition[0, 2] * command
    new_speed = transition[1, 0] * angle + transition[1, 1] * speed + transition[1, 2] * command
    allowed = math.inf
    if rig.speed_limit > 0.0:
        allowed = rig.speed_limit
    if rig.torque_limit > 0.0 and new_speed * torque > 0.0:
        left = (1.0 - abs(torque) / rig.torque_limit) / (1.0 - STALL_KNEE)
        allowed = min(allowed, STALL_SPEED * max(0.0, left))
    if abs(new_speed) > allowed:
        new_speed = math.copysign(allowed, new_speed)
        new_angle = angle + 0.5 * step * (speed + new_speed)
        if abs(speed) > allowed:
            new_angle = angle + step * new_speed
    s[ANGLE] = new_angle
    s[SPEED] = new_speed
    for index, share in ((FLANK_1, 1.0 - FLANK_SPREAD), (FLANK_2, 1.0 + FLANK_SPREAD)):
        half = 0.5 * share * rig.gear_gap
        s[index] = min(new_angle + half, max(new_angle - half, s[index]))


@compiled
def pulley_angle(s: Any, rig: Any) -> float:
    """Angle (rad) of the pulley: the shaft's, through play and ripple of the gear."""
    angle = 0.5 * (s[FLANK_1] + s[FLANK_2])
    if rig.cogging_amplitude != 0.0:
        turn = rig.cogging_periods * angle + rig.cogging_phase
        angle += rig.cogging_amplitude * (
            math.sin(turn)
            - math.sin(rig.cogging_phase)
            + rig.cogging_second * (math.sin(2.0 * turn) - math.sin(2.0 * rig.cogging_phase))
        )
    return float(angle)

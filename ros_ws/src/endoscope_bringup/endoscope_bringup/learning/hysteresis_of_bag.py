"""Motor and bending angle of each joint of a bag, laid on one even grid."""

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import JointStateSeries, Recording
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification import Recording as HysteresisRecording
from endoscope_core.identification import Servo

BENDING = 'slave/measured_js'
MOTOR = 'motor/measured_js'
MOTOR_COMMAND = 'motor/servo_jp'
DESIRED = 'slave/servo_jp'

GRID_STEP = 0.005
_COMMAND_STEP = 0.001

Array = NDArray[np.float64]


class NoHysteresisError(EndoscopeError, ValueError):
    """A bag that does not show both what a motor did and what the joint made of it."""


def hysteresis_of_bag(bag: Recording, gear: float) -> dict[str, HysteresisRecording]:
    """Motor angle and bending at the joint, at 200 Hz; `gear` is shaft rad for one rad of bending.

    The motor angle is the measured one; where it is missing, the motor's command or the desired
    angle passed through the nominal servo.
    """
    if not gear > 0.0:
        raise NoHysteresisError(f'gear = {gear} must be positive')
    bending = bag.joint_state(BENDING, finite=('position',))
    motor, scale, measured = _motor(bag, gear)
    origin = int(bending.stamp_ns[0])
    found = {}
    for joint in bending.names:
        name = joint if joint in motor.names else joint.replace('bend_', 'motor_')
        if name not in motor.names:
            continue
        driven = _angle_over_time(motor, name, origin)
        bent = _angle_over_time(bending, joint, origin)
        start, end = max(driven[0][0], bent[0][0]), min(driven[0][-1], bent[0][-1])
        if end - start < 1.0:
            continue
        grid = np.arange(start, end, GRID_STEP)
        angle = driven[1] / scale
        found[joint] = HysteresisRecording(
            np.interp(grid, driven[0], angle) if measured else _servo(driven[0], angle, grid),
            np.interp(grid, *bent),
            rested=False,
        )
    if not found:
        raise NoHysteresisError(
            f'{bag.path}: {motor.topic} ({", ".join(motor.names)}) and {bending.topic} '
            f'({", ".join(bending.names)}) have no joint in common for a second'
        )
    return found


def _motor(bag: Recording, gear: float) -> tuple[JointStateSeries, float, bool]:
    """Best account of the motors, what its angles are to be divided by, whether it is measured."""
    for topic, scale, measured in (
        (MOTOR, gear, True),
        (MOTOR_COMMAND, gear, False),
        (DESIRED, 1.0, False),
    ):
        if bag.has(topic):
            return bag.joint_state(topic, finite=('position',)), scale, measured
    raise NoHysteresisError(
        f'{bag.path}: lacks {MOTOR}, {MOTOR_COMMAND} and {DESIRED}: it does not say what the '
        'motors did'
    )


def _angle_over_time(series: JointStateSeries, joint: str, origin_ns: int) -> tuple[Array, Array]:
    """Seconds since `origin_ns` and angles of one joint, one for each stamp."""
    if series.position is None:
        raise NoHysteresisError(f'topic {series.topic} holds no positions')
    seconds = series.seconds(origin_ns)
    keep = np.concatenate(([True], np.diff(seconds) > 0.0))
    return seconds[keep], series.position[keep, series.names.index(joint)]


def _servo(stamps: Array, command: Array, grid: Array) -> Array:
    """What the nominal servo makes of a command that holds until the next one."""
    time = np.arange(stamps[0], grid[-1] + _COMMAND_STEP, _COMMAND_STEP)
    held = command[np.clip(np.searchsorted(stamps, time, side='right') - 1, 0, None)]
    return np.interp(grid, time, Servo().answer(held, _COMMAND_STEP))

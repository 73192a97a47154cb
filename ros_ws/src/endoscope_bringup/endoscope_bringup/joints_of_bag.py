"""What identification takes from a bag: the signals of each joint, on one even grid."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import JointStateSeries, Recording
from endoscope_core.errors import EndoscopeError
from endoscope_core.identification import HysteresisRecording, Servo
from endoscope_nodes.names import (
    MOTOR_COMMAND,
    MOTOR_MEASURED,
    SLAVE_COMMAND,
    SLAVE_MEASURED,
    WIRES_MEASURED,
)

GRID_STEP = 0.005
_STEP = 0.001

Array = NDArray[np.float64]


def hysteresis_of_bag(bag: Recording, gear: float) -> dict[str, HysteresisRecording]:
    """Motor angle and bending of each joint, at 200 Hz; `gear` is shaft rad for one of bending."""
    # Where no motor was measured its command or the desired angle is taken, through the nominal
    # servo.
    bending = bag.joint_state(SLAVE_MEASURED, finite=('position',))
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
        raise EndoscopeError(
            f'{bag.path}: {motor.topic} ({", ".join(motor.names)}) and {bending.topic} '
            f'({", ".join(bending.names)}) have no joint in common for a second'
        )
    return found


def _motor(bag: Recording, gear: float) -> tuple[JointStateSeries, float, bool]:
    """Best account of the motors, what its angles are to be divided by, whether it is measured."""
    for topic, scale in ((MOTOR_MEASURED, gear), (MOTOR_COMMAND, gear), (SLAVE_COMMAND, 1.0)):
        if bag.has(topic):
            series = bag.joint_state(topic, finite=('position',))
            return series, scale, topic == MOTOR_MEASURED
    raise EndoscopeError(
        f'{bag.path}: lacks {MOTOR_MEASURED}, {MOTOR_COMMAND} and {SLAVE_COMMAND}: it does not say '
        'what the motors did'
    )


def _angle_over_time(series: JointStateSeries, joint: str, origin_ns: int) -> tuple[Array, Array]:
    """Seconds since `origin_ns` and angles of one joint, one for each stamp."""
    seconds = series.seconds(origin_ns)
    keep = np.concatenate(([True], np.diff(seconds) > 0.0))
    return seconds[keep], series.select([joint]).require('position')[keep, 0]


def _servo(stamps: Array, command: Array, grid: Array) -> Array:
    """What the nominal servo makes of a command that holds until the next one."""
    time = np.arange(stamps[0], grid[-1] + _STEP, _STEP)
    return np.interp(grid, time, Servo().answer(_held(stamps, command, time), _STEP))


def _held(stamps: Array, command: Array, time: Array) -> Array:
    return command[np.clip(np.searchsorted(stamps, time, side='right') - 1, 0, None)]


@dataclass(frozen=True)
class PlantRecording:
    """One joint, N samples at 1 kHz."""

    command: Array  # (N,), joint-equivalent, rad
    tension: Array  # (N, 2), N
    bending: Array | None  # (N,), rad, NaN where the tracker says nothing


def plant_recordings_of_bag(bag: Recording, gear: float) -> dict[str, PlantRecording]:
    """Every joint with motor command and two tensions; `gear` is shaft rad for one of bending."""
    # The recording should begin at rest at zero, as a calibration does.
    for topic in (MOTOR_COMMAND, WIRES_MEASURED):
        if not bag.has(topic):
            raise EndoscopeError(f'{bag.path}: lacks {topic}, which shows the plant')
    motors = bag.joint_state(MOTOR_COMMAND, finite=('position',))
    wires = bag.joint_state(WIRES_MEASURED, finite=('effort',))
    bent = None
    if bag.has(SLAVE_MEASURED):
        bent = bag.joint_state(SLAVE_MEASURED, finite=('position',))
    origin = int(motors.stamp_ns[0])
    times, tension_times = motors.seconds(origin), wires.seconds(origin)
    grid = np.arange(max(0.0, tension_times[0]), min(times[-1], tension_times[-1]), _STEP)
    found = {}
    for name in ('x', 'y'):
        motor, pair = f'motor_{name}', (f'wire_{name}_pos', f'wire_{name}_neg')
        if motor not in motors.names or not set(pair) <= set(wires.names):
            continue
        command = motors.select([motor]).require('position')[:, 0]
        tension = wires.select(pair).require('effort')
        bending = None
        if bent is not None and bent.position is not None and f'bend_{name}' in bent.names:
            angle = bent.select([f'bend_{name}']).require('position')[:, 0]
            bending = np.interp(grid, bent.seconds(origin), angle, left=np.nan, right=np.nan)
        found[f'bend_{name}'] = PlantRecording(
            _held(times, command, grid) / gear,
            np.stack([np.interp(grid, tension_times, wire) for wire in tension.T], axis=1),
            bending,
        )
    if not found:
        raise EndoscopeError(f'{bag.path}: no joint has a motor command and two wire tensions')
    return found

"""Command, tensions and angle of each joint of a bag at 1 kHz, to identify the plant from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_bags import Recording
from endoscope_bringup.learning.hysteresis_of_bag import BENDING, MOTOR_COMMAND, NoHysteresisError

WIRES = 'wires/measured_js'
_STEP = 0.001

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PlantRecording:
    """One joint, N samples at 1 kHz."""

    command: Array  # (N,), joint-equivalent, rad
    tension: Array  # (N, 2), N
    bending: Array | None  # (N,), rad, NaN where the tracker says nothing


def plant_recordings_of_bag(bag: Recording, gear: float) -> dict[str, PlantRecording]:
    """Every joint with motor command and two tensions; `gear` is shaft rad for one of bending.

    The recording should begin at rest at zero, as a calibration does.
    """
    if not gear > 0.0:
        raise NoHysteresisError(f'gear = {gear} must be positive')
    for topic in (MOTOR_COMMAND, WIRES):
        if not bag.has(topic):
            raise NoHysteresisError(f'{bag.path}: lacks {topic}, which shows the plant')
    motors = bag.joint_state(MOTOR_COMMAND, finite=('position',))
    wires = bag.joint_state(WIRES, finite=('effort',))
    if motors.position is None or wires.effort is None:
        raise NoHysteresisError(f'{bag.path}: motor commands or tensions hold no values')
    origin = int(motors.stamp_ns[0])
    times, tension_times = motors.seconds(origin), wires.seconds(origin)
    grid = np.arange(max(0.0, tension_times[0]), min(times[-1], tension_times[-1]), _STEP)
    found = {}
    for name in ('x', 'y'):
        motor, pair = f'motor_{name}', (f'wire_{name}_pos', f'wire_{name}_neg')
        if motor not in motors.names or not set(pair) <= set(wires.names):
            continue
        held = np.clip(np.searchsorted(times, grid, side='right') - 1, 0, None)
        tension = [
            np.interp(grid, tension_times, wires.effort[:, wires.names.index(wire)])
            for wire in pair
        ]
        found[f'bend_{name}'] = PlantRecording(
            motors.position[held, motors.names.index(motor)] / gear,
            np.stack(tension, axis=1),
            _bending(bag, f'bend_{name}', origin, grid),
        )
    if not found:
        raise NoHysteresisError(f'{bag.path}: no joint has a motor command and two wire tensions')
    return found


def _bending(bag: Recording, joint: str, origin: int, grid: Array) -> Array | None:
    if not bag.has(BENDING):
        return None
    angles = bag.joint_state(BENDING, finite=('position',))
    if angles.position is None or joint not in angles.names:
        return None
    measured = angles.position[:, angles.names.index(joint)]
    return np.interp(grid, angles.seconds(origin), measured, left=np.nan, right=np.nan)

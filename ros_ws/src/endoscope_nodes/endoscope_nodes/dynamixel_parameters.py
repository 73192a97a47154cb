"""Parameters of the motor driver that are about a bus of Dynamixel servos."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from endoscope_devices.dynamixel.control_table import BAUD_CODES
from endoscope_devices.dynamixel.dynamixel_motors import DynamixelMotors
from endoscope_devices.dynamixel.settings import BusSettings, ServoMount
from endoscope_devices.motor_device import DeviceError
from endoscope_nodes.parameters import ParameterError, parameter


@dataclass(frozen=True)
class DynamixelParameters:
    """How the bus and its servos are set up; used where `device` is dynamixel."""

    port: str = parameter('/dev/ttyUSB0', 'serial port of the servos')
    baud: int = parameter(1_000_000, 'speed that the servos are set to', unit='baud', low=9600)
    servo_ids: tuple[int, ...] = parameter(
        (1, 2), 'ids of the servos of motor_x and motor_y', low=0, high=252
    )
    servo_directions: tuple[int, ...] = parameter(
        (1, 1), '-1 where the shaft is positive in the negative sense of its servo', low=-1, high=1
    )
    servo_zeros: tuple[float, ...] = parameter(
        (math.pi, math.pi), 'angle of each servo at which its shaft is at 0', unit='rad'
    )
    current_limit: float = parameter(
        0.5,
        'current at which the firmware of the servos limits the tension of the wires',
        unit='A',
        low=0.01,
        high=3.2,
    )
    bus_watchdog: float = parameter(
        0.1,
        'silence of the bus after which a servo stops by itself; in steps of 0.02',
        unit='s',
        low=0.02,
        high=2.54,
    )
    bus_rate: float = parameter(
        1000.0, 'cycles a second; 0 for as many as the bus carries', unit='Hz', low=0.0
    )
    fault_after: float = parameter(
        0.05,
        'time without a valid reading after which motion must be enabled anew',
        unit='s',
        low=0.005,
        high=1.0,
    )
    fast_sync_read: bool = parameter(
        False, 'one answer for all servos, which firmware 45 and newer can give'
    )


def build_motors(
    parameters: DynamixelParameters, names: Sequence[str], goal_timeout: float
) -> DynamixelMotors:
    """Make the bus that the parameters describe.

    Parameters
    ----------
    parameters
        Of the motor driver.
    names
        The motors.
    goal_timeout
        Time in s after which a goal that the node has not renewed is given up.

    Raises
    ------
    ParameterError
        They do not fit together.
    """
    p = parameters
    for name in ('servo_ids', 'servo_directions', 'servo_zeros'):
        if len(getattr(p, name)) != len(names):
            raise ParameterError(
                f"motor_driver: parameter '{name}' has {len(getattr(p, name))} values; give one "
                f'for each of {", ".join(names)}'
            )
    if len(set(p.servo_ids)) != len(names):
        raise ParameterError("motor_driver: parameter 'servo_ids' names a servo twice")
    if 0 in p.servo_directions:
        raise ParameterError("motor_driver: parameter 'servo_directions' is 0; give 1 or -1")
    if p.baud not in BAUD_CODES.values():
        known = ', '.join(str(baud) for baud in BAUD_CODES.values())
        raise ParameterError(f"motor_driver: parameter 'baud' is {p.baud}; give one of {known}")
    mounts = [
        ServoMount(*mount)
        for mount in zip(names, p.servo_ids, p.servo_directions, p.servo_zeros, strict=True)
    ]
    try:
        settings = BusSettings(
            p.port,
            p.baud,
            p.current_limit,
            p.bus_watchdog,
            rate=p.bus_rate,
            goal_timeout=goal_timeout,
            fault_after=p.fault_after,
            fast=p.fast_sync_read,
        )
    except DeviceError as error:
        raise ParameterError(f'motor_driver: {error}') from error
    return DynamixelMotors(settings, mounts)

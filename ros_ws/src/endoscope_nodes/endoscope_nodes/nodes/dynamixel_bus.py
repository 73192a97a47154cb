"""The bus of Dynamixel servos that the parameters of the motor driver describe."""

from collections.abc import Sequence

from endoscope_devices.dynamixel.control_table import BAUD_CODES
from endoscope_devices.dynamixel.dynamixel_motors import DynamixelMotors
from endoscope_devices.dynamixel.settings import BusSettings, ServoMount
from endoscope_devices.motor_device import DeviceError
from endoscope_nodes.runtime.node_parameters import DynamixelParameters
from endoscope_nodes.runtime.parameters import ParameterError


def build_motors(
    parameters: DynamixelParameters, names: Sequence[str], goal_timeout: float
) -> DynamixelMotors:
    """Make the bus; a goal not renewed for `goal_timeout` s is given up."""
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

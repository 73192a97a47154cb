"""Parameters of the nodes that drive or read a device; nothing here needs ROS."""

import math
from dataclasses import dataclass

from endoscope_core import choices
from endoscope_nodes.runtime.parameters import parameter


# fmt: off
@dataclass(frozen=True)
class MotorDriverParameters:
    """Parameters of the motor driver."""

    device: str = parameter('',
        'what is driven; empty for what the rig file says', choices=('', *choices.MOTOR_DEVICES))


@dataclass(frozen=True)
class DynamixelParameters:
    """How the bus and its servos are set up; used where `device` is dynamixel."""

    port: str = parameter('/dev/ttyUSB0', 'serial port of the servos')
    baud: int = parameter(1_000_000, 'speed that the servos are set to', 'baud', 9600)
    servo_ids: tuple[int, ...] = parameter((1, 2),
        'ids of the servos of motor_x and motor_y', low=0, high=252)
    servo_directions: tuple[int, ...] = parameter((1, 1),
        '-1 where the shaft is positive in the negative sense of its servo', low=-1, high=1)
    servo_zeros: tuple[float, ...] = parameter((math.pi, math.pi),
        'angle of each servo at which its shaft is at 0', 'rad')
    current_limit: float = parameter(0.5,
        'current at which the firmware of the servos limits the tension of the wires',
        'A', 0.01, 3.2)
    bus_watchdog: float = parameter(0.1,
        'silence of the bus after which a servo stops by itself; in steps of 0.02', 's', 0.02, 2.54)
    bus_rate: float = parameter(1000.0,
        'cycles a second; 0 for as many as the bus carries', 'Hz', 0.0)
    fault_after: float = parameter(0.05,
        'time without a valid reading after which motion must be enabled again', 's', 0.005, 1.0)


@dataclass(frozen=True)
class LoadCellsParameters:
    """Parameters of the load cells."""

    device: str = parameter('',
        'what is read; empty for what the rig file says', choices=('', *choices.LOAD_CELL_DEVICES))
    port: str = parameter('', 'serial port of a modbus_rtu device, HOST:PORT of a modbus_tcp one')
    calibration_file: str = parameter('',
        'YAML file with registers, sensitivity, sign and zero of each cell of a real device')
    connected: bool = parameter(True,
        'false makes the simulated cells fall silent, as an unplugged cable does', dynamic=True)


@dataclass(frozen=True)
class EmTrackerParameters:
    """Parameters of the EM tracker."""

    device: str = parameter('',
        'what is read; empty for what the rig file says', choices=('', *choices.TRACKER_DEVICES))
    port: str = parameter('', 'serial port of an aurora')
    tool: int = parameter(1,
        'which of the sensors that are plugged in, in the order of their ports', low=1, high=32)
    latency: float = parameter(0.0,
        'time from measuring to having a frame, taken off its stamp', 's', 0.0, 0.5)
    sensor_roll: float = parameter(0.0,
        "angle about the instrument's axis from its x axis to the sensor's, as it is mounted",
        'rad', -math.pi, math.pi)
    registration_file: str = parameter('',
        'where the pose of the straight instrument is kept; empty to forget it')
    in_volume: bool = parameter(True,
        'false makes the simulated tracker lose its sensor, which then is silent', dynamic=True)

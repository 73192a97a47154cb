"""The control table of the XM430 servos: the one place that knows addresses, sizes and units.

Source: ROBOTIS e-manual, XM430-W350 and XM430-W210, 'Control Table of EEPROM Area' and 'Control
Table of RAM Area'; torque and speed from 'Specifications' at 12 V.
"""

import math
from dataclasses import dataclass

RPM = 2.0 * math.pi / 60.0

COUNTS_PER_TURN = 4096
COUNT = 2.0 * math.pi / COUNTS_PER_TURN
VELOCITY_UNIT = 0.229 * RPM
CURRENT_UNIT = 2.69e-3
RETURN_DELAY_UNIT = 2e-6
WATCHDOG_UNIT = 20e-3
TICK_UNIT = 1e-3
TICK_PERIOD = 32768

CURRENT_BASED_POSITION = 5
WATCHDOG_TRIPPED = -1
# What Model Information(2) of an emulated servo reads, so that nobody takes it for a real one.
EMULATED = int.from_bytes(b'EMUL', 'little')
MULTI_TURN_LIMIT = 1_048_575

BAUD_CODES = {
    0: 9_600,
    1: 57_600,
    2: 115_200,
    3: 1_000_000,
    4: 2_000_000,
    5: 3_000_000,
    6: 4_000_000,
    7: 4_500_000,
}


@dataclass(frozen=True)
class Register:
    """One entry of the control table."""

    name: str  # as the e-manual calls it
    address: int  # first byte
    size: int  # bytes, little endian
    unit: str = ''  # SI unit of ``scale``; empty for codes and flags
    scale: float = 1.0  # SI units in one count
    signed: bool = False  # two's complement
    writable: bool = True  # access is RW rather than R
    eeprom: bool = False  # kept without power, and only writable while torque is off
    initial: int = 0  # factory value (for RAM: the value after power-up)
    low: int | None = None  # with `high`, the allowed counts
    high: int | None = None

    def encode(self, counts: int) -> bytes:
        """Little-endian bytes of a value in counts; OverflowError where it does not fit."""
        return counts.to_bytes(self.size, 'little', signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Value in counts of little-endian bytes, with its sign."""
        return int.from_bytes(data, 'little', signed=self.signed)


def _eeprom(name: str, address: int, size: int, initial: int, **more: object) -> Register:
    return Register(name, address, size, eeprom=True, initial=initial, **more)  # type: ignore[arg-type]


MODEL_NUMBER = _eeprom('Model Number', 0, 2, 1020, writable=False)
MODEL_INFORMATION = _eeprom('Model Information', 2, 4, 0, writable=False)
FIRMWARE_VERSION = _eeprom('Firmware Version', 6, 1, 45, writable=False)
ID = _eeprom('ID', 7, 1, 1, low=0, high=252)
BAUD_RATE = _eeprom('Baud Rate', 8, 1, 1, low=0, high=7)
RETURN_DELAY_TIME = _eeprom(
    'Return Delay Time', 9, 1, 250, unit='s', scale=RETURN_DELAY_UNIT, low=0, high=254
)
DRIVE_MODE = _eeprom('Drive Mode', 10, 1, 0, low=0, high=13)
OPERATING_MODE = _eeprom('Operating Mode', 11, 1, 3, low=0, high=16)
SECONDARY_ID = _eeprom('Secondary ID', 12, 1, 255, low=0, high=255)
PROTOCOL_TYPE = _eeprom('Protocol Type', 13, 1, 2, low=1, high=2)
HOMING_OFFSET = _eeprom(
    'Homing Offset', 20, 4, 0, unit='rad', scale=COUNT, signed=True, low=-1_044_479, high=1_044_479
)
MOVING_THRESHOLD = _eeprom(
    'Moving Threshold', 24, 4, 10, unit='rad/s', scale=VELOCITY_UNIT, low=0, high=1023
)
TEMPERATURE_LIMIT = _eeprom('Temperature Limit', 31, 1, 80, unit='°C', low=0, high=100)
MAX_VOLTAGE_LIMIT = _eeprom('Max Voltage Limit', 32, 2, 160, unit='V', scale=0.1, low=95, high=160)
MIN_VOLTAGE_LIMIT = _eeprom('Min Voltage Limit', 34, 2, 95, unit='V', scale=0.1, low=95, high=160)
PWM_LIMIT = _eeprom('PWM Limit', 36, 2, 885, unit='%', scale=0.113, low=0, high=885)
CURRENT_LIMIT = _eeprom(
    'Current Limit', 38, 2, 1193, unit='A', scale=CURRENT_UNIT, low=0, high=1193
)
VELOCITY_LIMIT = _eeprom(
    'Velocity Limit', 44, 4, 200, unit='rad/s', scale=VELOCITY_UNIT, low=0, high=1023
)
MAX_POSITION_LIMIT = _eeprom(
    'Max Position Limit', 48, 4, 4095, unit='rad', scale=COUNT, low=0, high=4095
)
MIN_POSITION_LIMIT = _eeprom(
    'Min Position Limit', 52, 4, 0, unit='rad', scale=COUNT, low=0, high=4095
)
STARTUP_CONFIGURATION = _eeprom('Startup Configuration', 60, 1, 0, low=0, high=3)
SHUTDOWN = _eeprom('Shutdown', 63, 1, 52, low=0, high=63)

TORQUE_ENABLE = Register('Torque Enable', 64, 1, low=0, high=1)
LED = Register('LED', 65, 1, low=0, high=1)
STATUS_RETURN_LEVEL = Register('Status Return Level', 68, 1, initial=2, low=0, high=2)
REGISTERED_INSTRUCTION = Register('Registered Instruction', 69, 1, writable=False)
HARDWARE_ERROR_STATUS = Register('Hardware Error Status', 70, 1, writable=False)
VELOCITY_I_GAIN = Register('Velocity I Gain', 76, 2, initial=1920, low=0, high=16383)
VELOCITY_P_GAIN = Register('Velocity P Gain', 78, 2, initial=100, low=0, high=16383)
POSITION_D_GAIN = Register('Position D Gain', 80, 2, low=0, high=16383)
POSITION_I_GAIN = Register('Position I Gain', 82, 2, low=0, high=16383)
POSITION_P_GAIN = Register('Position P Gain', 84, 2, initial=800, low=0, high=16383)
FEEDFORWARD_2ND_GAIN = Register('Feedforward 2nd Gain', 88, 2, low=0, high=16383)
FEEDFORWARD_1ST_GAIN = Register('Feedforward 1st Gain', 90, 2, low=0, high=16383)
BUS_WATCHDOG = Register('Bus Watchdog', 98, 1, 's', WATCHDOG_UNIT, signed=True, low=0, high=127)
GOAL_PWM = Register('Goal PWM', 100, 2, '%', 0.113, signed=True, initial=885, low=-885, high=885)
GOAL_CURRENT = Register(
    'Goal Current', 102, 2, 'A', CURRENT_UNIT, signed=True, initial=1193, low=-1193, high=1193
)
GOAL_VELOCITY = Register(
    'Goal Velocity', 104, 4, 'rad/s', VELOCITY_UNIT, signed=True, low=-1023, high=1023
)
PROFILE_ACCELERATION = Register('Profile Acceleration', 108, 4, low=0, high=32767)
PROFILE_VELOCITY = Register('Profile Velocity', 112, 4, 'rad/s', VELOCITY_UNIT, low=0, high=32767)
GOAL_POSITION = Register(
    'Goal Position',
    116,
    4,
    'rad',
    COUNT,
    signed=True,
    low=-MULTI_TURN_LIMIT,
    high=MULTI_TURN_LIMIT,
)
REALTIME_TICK = Register('Realtime Tick', 120, 2, 's', TICK_UNIT, writable=False)
MOVING = Register('Moving', 122, 1, writable=False)
MOVING_STATUS = Register('Moving Status', 123, 1, writable=False)
PRESENT_PWM = Register('Present PWM', 124, 2, '%', 0.113, signed=True, writable=False)
PRESENT_CURRENT = Register(
    'Present Current', 126, 2, 'A', CURRENT_UNIT, signed=True, writable=False
)
PRESENT_VELOCITY = Register(
    'Present Velocity', 128, 4, 'rad/s', VELOCITY_UNIT, signed=True, writable=False
)
PRESENT_POSITION = Register('Present Position', 132, 4, 'rad', COUNT, signed=True, writable=False)
VELOCITY_TRAJECTORY = Register(
    'Velocity Trajectory', 136, 4, 'rad/s', VELOCITY_UNIT, signed=True, writable=False
)
POSITION_TRAJECTORY = Register(
    'Position Trajectory', 140, 4, 'rad', COUNT, signed=True, writable=False
)
PRESENT_INPUT_VOLTAGE = Register(
    'Present Input Voltage', 144, 2, 'V', 0.1, writable=False, initial=120
)
PRESENT_TEMPERATURE = Register('Present Temperature', 146, 1, '°C', writable=False, initial=30)

CONTROL_TABLE = tuple(value for value in list(globals().values()) if isinstance(value, Register))

INDIRECT_ADDRESS = 168
INDIRECT_DATA = 224
INDIRECT_COUNT = 28
INDIRECT_ADDRESS_29 = 578
INDIRECT_DATA_29 = 634
TABLE_SIZE = 662


@dataclass(frozen=True)
class ServoModel:
    """What the e-manual's 'Specifications' say of a servo at 12 V."""

    name: str  # as printed on it
    torque_constant: float  # stall torque by stall current, N m/A
    no_load_speed: float  # rad/s


MODELS = {
    1020: ServoModel('XM430-W350', 4.1 / 2.3, 46.0 * RPM),
    1030: ServoModel('XM430-W210', 3.0 / 2.3, 77.0 * RPM),
}

_ERROR_NUMBERS = {
    1: 'the instruction failed',
    2: 'unknown instruction',
    3: 'the CRC of the instruction is wrong',
    4: 'a value is out of range',
    5: 'the data are too short for the register',
    6: 'a value is beyond a limit',
    7: 'the address cannot be accessed',
}
_HARDWARE_ERRORS = {
    0: 'input voltage',
    2: 'overheating',
    3: 'motor encoder',
    4: 'electrical shock',
    5: 'overload',
}
ALERT = 0x80


def error_in_words(error: int) -> str:
    """What the error byte of a status packet says (e-manual 'Protocol 2.0', 'Error').

    Its highest bit alone means that Hardware Error Status(70) is not zero.
    """
    number = error & ~ALERT
    words = [_ERROR_NUMBERS.get(number, f'error number {number}')] if number else []
    if error & ALERT:
        words.append('hardware error')
    return ', '.join(words)


def hardware_errors_in_words(status: int) -> str:
    """Name the bits of Hardware Error Status(70); empty for none."""
    return ', '.join(
        _HARDWARE_ERRORS.get(bit, f'unknown bit {bit}') for bit in range(8) if status >> bit & 1
    )

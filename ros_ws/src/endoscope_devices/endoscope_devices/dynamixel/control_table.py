"""What is used of the control table of the XM430 servos: addresses, sizes and units.

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


def eeprom(name: str, address: int, size: int, initial: int, **more: object) -> Register:
    """One that is kept without power."""
    return Register(name, address, size, eeprom=True, initial=initial, **more)  # type: ignore[arg-type]


MODEL_NUMBER = eeprom('Model Number', 0, 2, 1020, writable=False)
MODEL_INFORMATION = eeprom('Model Information', 2, 4, 0, writable=False)
FIRMWARE_VERSION = eeprom('Firmware Version', 6, 1, 45, writable=False)
RETURN_DELAY_TIME = eeprom(
    'Return Delay Time', 9, 1, 250, unit='s', scale=RETURN_DELAY_UNIT, low=0, high=254
)
DRIVE_MODE = eeprom('Drive Mode', 10, 1, 0, low=0, high=13)
OPERATING_MODE = eeprom('Operating Mode', 11, 1, 3, low=0, high=16)
TEMPERATURE_LIMIT = eeprom('Temperature Limit', 31, 1, 80, unit='°C', low=0, high=100)
CURRENT_LIMIT = eeprom('Current Limit', 38, 2, 1193, unit='A', scale=CURRENT_UNIT, low=0, high=1193)
SHUTDOWN = eeprom('Shutdown', 63, 1, 52, low=0, high=63)

TORQUE_ENABLE = Register('Torque Enable', 64, 1, low=0, high=1)
STATUS_RETURN_LEVEL = Register('Status Return Level', 68, 1, initial=2, low=0, high=2)
HARDWARE_ERROR_STATUS = Register('Hardware Error Status', 70, 1, writable=False)
BUS_WATCHDOG = Register('Bus Watchdog', 98, 1, 's', WATCHDOG_UNIT, signed=True, low=0, high=127)
GOAL_CURRENT = Register(
    'Goal Current', 102, 2, 'A', CURRENT_UNIT, signed=True, initial=1193, low=-1193, high=1193
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
PRESENT_CURRENT = Register(
    'Present Current', 126, 2, 'A', CURRENT_UNIT, signed=True, writable=False
)
PRESENT_INPUT_VOLTAGE = Register(
    'Present Input Voltage', 144, 2, 'V', 0.1, writable=False, initial=120
)
PRESENT_TEMPERATURE = Register('Present Temperature', 146, 1, '°C', writable=False, initial=30)

INDIRECT_ADDRESS = 168
INDIRECT_DATA = 224


@dataclass(frozen=True)
class ServoModel:
    """'Specifications' of the e-manual for a servo at 12 V."""

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
    """Error byte of a status packet in words; its highest bit: see Hardware Error Status(70)."""
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

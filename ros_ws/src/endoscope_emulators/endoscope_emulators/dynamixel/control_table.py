"""The whole control table of the XM430 servos, with the registers that no driver uses.

Source: as that of `endoscope_devices.dynamixel.control_table`.
"""

from endoscope_devices.dynamixel import control_table as table

ID = table.eeprom('ID', 7, 1, 1, low=0, high=252)
BAUD_RATE = table.eeprom('Baud Rate', 8, 1, 1, low=0, high=7)
SECONDARY_ID = table.eeprom('Secondary ID', 12, 1, 255, low=0, high=255)
PROTOCOL_TYPE = table.eeprom('Protocol Type', 13, 1, 2, low=1, high=2)
HOMING_OFFSET = table.eeprom(
    'Homing Offset',
    20,
    4,
    0,
    unit='rad',
    scale=table.COUNT,
    signed=True,
    low=-1_044_479,
    high=1_044_479,
)
MOVING_THRESHOLD = table.eeprom(
    'Moving Threshold', 24, 4, 10, unit='rad/s', scale=table.VELOCITY_UNIT, low=0, high=1023
)
MAX_VOLTAGE_LIMIT = table.eeprom(
    'Max Voltage Limit', 32, 2, 160, unit='V', scale=0.1, low=95, high=160
)
MIN_VOLTAGE_LIMIT = table.eeprom(
    'Min Voltage Limit', 34, 2, 95, unit='V', scale=0.1, low=95, high=160
)
PWM_LIMIT = table.eeprom('PWM Limit', 36, 2, 885, unit='%', scale=0.113, low=0, high=885)
VELOCITY_LIMIT = table.eeprom(
    'Velocity Limit', 44, 4, 200, unit='rad/s', scale=table.VELOCITY_UNIT, low=0, high=1023
)
MAX_POSITION_LIMIT = table.eeprom(
    'Max Position Limit', 48, 4, 4095, unit='rad', scale=table.COUNT, low=0, high=4095
)
MIN_POSITION_LIMIT = table.eeprom(
    'Min Position Limit', 52, 4, 0, unit='rad', scale=table.COUNT, low=0, high=4095
)
STARTUP_CONFIGURATION = table.eeprom('Startup Configuration', 60, 1, 0, low=0, high=3)
LED = table.Register('LED', 65, 1, low=0, high=1)
REGISTERED_INSTRUCTION = table.Register('Registered Instruction', 69, 1, writable=False)
VELOCITY_I_GAIN = table.Register('Velocity I Gain', 76, 2, initial=1920, low=0, high=16383)
VELOCITY_P_GAIN = table.Register('Velocity P Gain', 78, 2, initial=100, low=0, high=16383)
POSITION_D_GAIN = table.Register('Position D Gain', 80, 2, low=0, high=16383)
POSITION_I_GAIN = table.Register('Position I Gain', 82, 2, low=0, high=16383)
POSITION_P_GAIN = table.Register('Position P Gain', 84, 2, initial=800, low=0, high=16383)
FEEDFORWARD_2ND_GAIN = table.Register('Feedforward 2nd Gain', 88, 2, low=0, high=16383)
FEEDFORWARD_1ST_GAIN = table.Register('Feedforward 1st Gain', 90, 2, low=0, high=16383)
GOAL_PWM = table.Register(
    'Goal PWM', 100, 2, '%', 0.113, signed=True, initial=885, low=-885, high=885
)
GOAL_VELOCITY = table.Register(
    'Goal Velocity', 104, 4, 'rad/s', table.VELOCITY_UNIT, signed=True, low=-1023, high=1023
)
MOVING = table.Register('Moving', 122, 1, writable=False)
MOVING_STATUS = table.Register('Moving Status', 123, 1, writable=False)
PRESENT_PWM = table.Register('Present PWM', 124, 2, '%', 0.113, signed=True, writable=False)
PRESENT_VELOCITY = table.Register(
    'Present Velocity', 128, 4, 'rad/s', table.VELOCITY_UNIT, signed=True, writable=False
)
PRESENT_POSITION = table.Register(
    'Present Position', 132, 4, 'rad', table.COUNT, signed=True, writable=False
)
VELOCITY_TRAJECTORY = table.Register(
    'Velocity Trajectory', 136, 4, 'rad/s', table.VELOCITY_UNIT, signed=True, writable=False
)
POSITION_TRAJECTORY = table.Register(
    'Position Trajectory', 140, 4, 'rad', table.COUNT, signed=True, writable=False
)

CONTROL_TABLE = tuple(
    sorted(
        (r for r in (*vars(table).values(), *globals().values()) if isinstance(r, table.Register)),
        key=lambda register: register.address,
    )
)

INDIRECT_COUNT = 28
INDIRECT_ADDRESS_29 = 578
INDIRECT_DATA_29 = 634
TABLE_SIZE = 662

"""The emulator serves ROBOTIS's own client, unchanged, and keeps to the manual."""

import pytest
from dynamixel_sdk import COMM_SUCCESS
from dynamixel_sdk import PacketHandler as SdkPacketHandler
from patient_clients import PatientPort

from endoscope_devices.dynamixel import control_table as table
from endoscope_emulators.dynamixel.bus import EmulatedBus
from endoscope_emulators.dynamixel.servo import EmulatedServo, ErrorNumber

ACCESS, RANGE, LENGTH, LIMIT = (
    ErrorNumber.ACCESS,
    ErrorNumber.DATA_RANGE,
    ErrorNumber.DATA_LENGTH,
    ErrorNumber.DATA_LIMIT,
)


@pytest.fixture
def bus():
    with EmulatedBus([EmulatedServo(1), EmulatedServo(2, model=1030)]) as bus:
        yield bus


@pytest.fixture
def port(bus):
    port = PatientPort(bus.port)
    port.setBaudRate(1_000_000)
    yield port
    port.closePort()


sdk = SdkPacketHandler(2.0)


def test_the_sdk_finds_both_servos(port):
    assert sdk.ping(port, 1) == (1020, COMM_SUCCESS, 0)
    assert sdk.ping(port, 2)[0] == 1030
    found, result = sdk.broadcastPing(port)
    assert result == COMM_SUCCESS
    assert found == {1: [1020, 45], 2: [1030, 45]}
    port.patience = 0.0
    assert sdk.ping(port, 3)[1] != COMM_SUCCESS


def test_the_sdk_reads_and_writes_registers(port):
    assert sdk.read4ByteTxRx(port, 1, 132) == (2048, COMM_SUCCESS, 0)
    assert sdk.read2ByteTxRx(port, 1, 144) == (120, COMM_SUCCESS, 0)
    assert sdk.write1ByteTxRx(port, 1, 11, 5) == (COMM_SUCCESS, 0)
    assert sdk.read1ByteTxRx(port, 1, 11)[0] == 5
    assert sdk.write1ByteTxRx(port, 1, 64, 1) == (COMM_SUCCESS, 0)
    assert sdk.write4ByteTxRx(port, 1, 116, 2100) == (COMM_SUCCESS, 0)
    for _ in range(300):
        position = sdk.read4ByteTxRx(port, 1, 132)[0]
        if position == 2100:
            break
    # A servo stands still within a count of its goal.
    assert abs(position - 2100) <= 1


@pytest.mark.parametrize(
    ('address', 'size', 'value', 'error'),
    [
        (0, 2, 1021, ACCESS),
        (132, 4, 5, ACCESS),
        (14, 1, 0, ACCESS),
        (8, 1, 9, RANGE),
        (116, 2, 5, LENGTH),
        (102, 2, 1193, 0),
        (102, 2, 1194, RANGE),
        (116, 4, 1_048_576, RANGE),
        (168, 2, 700, RANGE),
    ],
)
def test_what_the_manual_refuses(port, address, size, value, error):
    data = list(value.to_bytes(size, 'little'))
    assert sdk.writeTxRx(port, 1, address, size, data) == (COMM_SUCCESS, error)


def test_eeprom_is_closed_while_torque_is_on(port):
    sdk.write1ByteTxRx(port, 1, 64, 1)
    assert sdk.write2ByteTxRx(port, 1, 38, 100) == (COMM_SUCCESS, ACCESS)
    sdk.write1ByteTxRx(port, 1, 64, 0)
    assert sdk.write2ByteTxRx(port, 1, 38, 100) == (COMM_SUCCESS, 0)
    assert sdk.write2ByteTxRx(port, 1, 102, 101) == (COMM_SUCCESS, LIMIT)


def test_indirect_data_show_what_their_addresses_say_until_a_reboot(port):
    for k in range(4):
        sdk.write2ByteTxRx(port, 1, 168 + 2 * k, 132 + k)
    assert sdk.read4ByteTxRx(port, 1, 224)[0] == 2048
    assert sdk.reboot(port, 1) == (COMM_SUCCESS, 0)
    port.patience = 0.0
    while sdk.ping(port, 1)[1] != COMM_SUCCESS:
        pass
    port.patience = PatientPort.patience
    assert sdk.read4ByteTxRx(port, 1, 224)[0] == 0


def servo_in_motion():
    servo = EmulatedServo(1)
    servo.advance(0.0)
    assert servo.write(table.BUS_WATCHDOG.address, b'\x05') == 0
    assert servo.write(table.TORQUE_ENABLE.address, b'\x01') == 0
    assert servo.write(table.GOAL_POSITION.address, (3000).to_bytes(4, 'little')) == 0
    return servo


def test_the_watchdog_stops_the_shaft_and_makes_goals_read_only():
    servo = servo_in_motion()
    servo.advance(0.0995)
    assert servo.value(table.BUS_WATCHDOG) == 5
    servo.advance(0.102)
    assert servo.value(table.BUS_WATCHDOG) == -1
    stopped = servo.shaft.position
    servo.advance(1.0)
    assert abs(servo.shaft.position - stopped) < 2e-3
    goal = (2500).to_bytes(4, 'little')
    assert servo.write(table.GOAL_POSITION.address, goal) == RANGE
    assert servo.write(table.BUS_WATCHDOG.address, b'\x00') == 0
    assert servo.write(table.GOAL_POSITION.address, goal) == 0


def test_the_current_limit_stops_the_shaft_and_overload_lets_it_go():
    servo = EmulatedServo(1)
    servo.advance(0.0)
    servo.shaft.stiffness = 1.0
    servo.write(table.OPERATING_MODE.address, b'\x05')
    servo.write(table.CURRENT_LIMIT.address, (50).to_bytes(2, 'little'))
    servo.write(table.GOAL_CURRENT.address, (50).to_bytes(2, 'little'))
    servo.write(table.TORQUE_ENABLE.address, b'\x01')
    servo.write(table.GOAL_POSITION.address, (3000).to_bytes(4, 'little'))
    servo.advance(0.5)
    reach = 50 * table.CURRENT_UNIT * servo.shaft.torque_constant / servo.shaft.stiffness
    assert servo.shaft.position - servo.shaft.rest == pytest.approx(reach, rel=1e-3)
    assert servo.value(table.PRESENT_CURRENT) == 50
    assert servo.alert() == 0
    servo.advance(3.0)
    assert servo.value(table.HARDWARE_ERROR_STATUS) == 0x20
    assert servo.value(table.TORQUE_ENABLE) == 0
    assert servo.alert() == 0x80
    assert servo.write(table.TORQUE_ENABLE.address, b'\x01') != 0


def test_the_tick_counts_milliseconds_and_begins_anew():
    servo = EmulatedServo(1)
    servo.advance(100.0)
    servo.advance(100.25)
    assert servo.value(table.REALTIME_TICK) == 250
    servo.advance(100.0 + 32.768 + 0.007)
    assert servo.value(table.REALTIME_TICK) == 7

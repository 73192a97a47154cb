"""Servos behind the motor driver's interface: set-up, motion, and what is refused."""

import os
import threading
import time
import tty

import pytest
from patient_clients import PATIENCE_S, opened

from endoscope_core.rig import Kind
from endoscope_devices.device import DeviceError
from endoscope_devices.dynamixel.bring_up import BusSettings, ServoMount
from endoscope_devices.dynamixel.control_table import (
    ALERT,
    CURRENT_UNIT,
    GOAL_CURRENT,
    MODEL_INFORMATION,
    OPERATING_MODE,
    RETURN_DELAY_TIME,
    TORQUE_ENABLE,
)
from endoscope_devices.dynamixel.doctor import examine
from endoscope_devices.dynamixel.dynamixel_motors import DynamixelMotors
from endoscope_devices.dynamixel.packet_handler import (
    BusError,
    NoReplyError,
    PacketHandler,
    sync_write_request,
)
from endoscope_devices.dynamixel.serial_port import BusPort
from endoscope_emulators.dynamixel.bus import EmulatedBus
from endoscope_emulators.dynamixel.control_table import BAUD_RATE, GOAL_VELOCITY
from endoscope_emulators.dynamixel.process import EmulatorProcess
from endoscope_emulators.dynamixel.servo import EmulatedServo

# A busy machine may keep the emulator from answering for a while.
PATIENT_MARGIN_S = 0.3
MOUNTS = (ServoMount('motor_x', 1), ServoMount('motor_y', 2, direction=-1))


@pytest.fixture
def emulator():
    with EmulatorProcess() as emulator:
        yield emulator


@pytest.fixture
def motors(emulator):
    motors = opened(BusSettings(emulator.port), MOUNTS)
    yield motors
    motors.close()


def drive(motors, goal, until, *, arming=False):
    """Renew the goal each millisecond until something holds; the readings on the way.

    With `arming`, torque is asked for as often as it takes: a stall of the machine is a fault like
    any other.
    """
    readings = []
    deadline, asked = time.monotonic() + PATIENCE_S, 0.0
    while not until():
        assert time.monotonic() < deadline, (motors.trouble(), motors.health())
        if arming and not motors.bus.armed and time.monotonic() - asked > 1.0:
            asked = time.monotonic()
            motors.set_torque(True)
        reading = motors.exchange(goal, 1)
        if reading is not None:
            readings.append(reading)
        time.sleep(1e-3)
    return readings


def arm(motors, goal=(0.0, 0.0)):
    drive(motors, goal, lambda: motors.bus.armed, arming=True)


def near(motors, goal):
    def reached():
        newest = motors.bus.newest
        return newest is not None and all(
            abs(p - g) < 2e-3 for p, g in zip(newest.reading.position, goal, strict=True)
        )

    return reached


def test_the_servos_are_set_up_as_asked(emulator, motors):
    for device in (1, 2):
        state = emulator.state(device)
        assert (state['mode'], state['watchdog'], state['torque']) == (5, 5, 0)
        assert state['current_limit'] == int(0.5 / CURRENT_UNIT)


def test_goals_are_followed_in_the_sense_of_the_shafts(emulator, motors):
    readings = drive(motors, (0.3, 0.2), near(motors, (0.3, 0.2)), arming=True)
    assert max(r.velocity[0] for r in readings) > 0.5
    assert readings[-1].effort[1] == pytest.approx(0.2 * 0.2, abs=0.01)
    assert emulator.state(1)['position'] > 3.4
    assert emulator.state(2)['position'] < 3.0
    drive(motors, (0.3, 0.2), lambda: motors.trouble() == '', arming=True)


def test_enabling_does_not_move_the_shafts(emulator, motors):
    drive(motors, (0.3, 0.0), near(motors, (0.3, 0.0)), arming=True)
    motors.set_torque(False)
    drive(motors, (0.0, 0.0), lambda: emulator.state(1)['torque'] == 0)
    began = time.monotonic()
    arm(motors, (0.3, 0.0))
    track = [position for _, position in emulator.do('trace', 1, began)]
    assert max(track) - min(track) < 2e-3


def test_without_torque_no_goal_is_sent(emulator, motors):
    before = emulator.state(1)['goal']
    drive(motors, (0.5, 0.5), lambda: motors.bus.figures.readings > 100)
    assert emulator.state(1)['goal'] == before


def test_a_setting_that_is_not_kept_is_refused_by_name(emulator):
    emulator.do('stick', 2, 38)
    with pytest.raises(BusError, match=r'servo 2 .*Current Limit\(38\) reads 1193'):
        DynamixelMotors(BusSettings(emulator.port), MOUNTS).open()


def test_torque_that_does_not_come_on_is_refused(emulator, motors):
    emulator.do('stick', 1, 64)
    drive(
        motors, (0.0, 0.0), lambda: 'does not switch its torque on' in motors.trouble(), arming=True
    )
    assert not motors.bus.armed


def test_another_model_is_refused():
    with EmulatedBus([EmulatedServo(1, model=1060)]) as bus:
        motors = DynamixelMotors(BusSettings(bus.port), MOUNTS[:1])
        with pytest.raises(BusError, match='model number 1060'):
            motors.open()


def test_a_missing_servo_is_named(emulator):
    mounts = (MOUNTS[0], ServoMount('motor_y', 7))
    with pytest.raises(NoReplyError, match=r'servo 7 .*does not answer at 1000000 baud'):
        DynamixelMotors(BusSettings(emulator.port), mounts).open()


def test_a_port_that_cannot_be_used_is_named(emulator, motors):
    with pytest.raises(DeviceError, match='there is no such port'):
        BusPort('/dev/ttyNone', 1_000_000).open()
    with pytest.raises(DeviceError, match='another program uses this port'):
        BusPort(emulator.port, 1_000_000).open()
    with pytest.raises(DeviceError, match='do not know 1234 baud'):
        BusPort(emulator.port, 1234).open()


@pytest.mark.parametrize(
    ('changes', 'words'),
    [({'watchdog': 3.0}, 'Bus Watchdog'), ({'current_limit': 4.0}, 'Current Limit')],
)
def test_settings_that_no_servo_can_have_are_refused(changes, words):
    with pytest.raises(DeviceError, match=words):
        BusSettings('/dev/ttyNone', **changes)


@pytest.fixture
def port_that_goes_away():
    """A terminal whose other end closes at the first request."""
    far, near_end = os.openpty()
    tty.setraw(near_end)

    def go_away():
        os.read(far, 1)
        os.close(far)

    thread = threading.Thread(target=go_away)
    thread.start()
    yield os.ttyname(near_end)
    os.close(near_end)
    thread.join()


def test_an_adapter_that_goes_away_during_the_set_up_is_named(port_that_goes_away):
    with pytest.raises(DeviceError, match='the adapter is gone'):
        DynamixelMotors(BusSettings(port_that_goes_away), MOUNTS).open()


def test_an_adapter_that_goes_away_under_the_doctor_is_named(port_that_goes_away):
    (advice,) = examine(port_that_goes_away, [1_000_000]).advice
    assert 'the adapter is gone' in advice


@pytest.fixture
def line():
    with EmulatedBus([EmulatedServo(1)]) as line:
        yield line


@pytest.fixture
def handler(line):
    port = BusPort(line.port, 1_000_000)
    port.open()
    yield PacketHandler(port, margin=PATIENT_MARGIN_S)
    port.close()


def test_a_goal_that_is_not_where_the_shaft_is_is_refused(line):
    motors = opened(BusSettings(line.port), MOUNTS[:1])
    try:
        with line.paused():
            line.servos[1].shaft.position += 0.2
            line.servos[1].stuck = {116}
        drive(motors, (0.2,), near(motors, (0.2,)))
        drive(
            motors, (0.2,), lambda: 'Goal Position(116) reads 2048' in motors.trouble(), arming=True
        )
        assert line.servos[1].value(TORQUE_ENABLE) == 0
        assert not motors.bus.armed
    finally:
        motors.close()


def test_the_time_out_is_the_time_on_the_wire_and_a_margin(handler):
    handler = PacketHandler(handler.port, return_delay=0.0)
    wire = (16 + 2 * (11 + 13)) * 10 / 1_000_000
    assert handler.time_out(16, [13, 13]) == pytest.approx(wire + handler.margin)
    assert handler.margin < 0.01


def test_a_refusal_is_an_error_with_its_reason(handler):
    with pytest.raises(BusError, match=r'servo 1 .*refuses write .*cannot be accessed'):
        handler.write(1, 132, bytes(4))
    with pytest.raises(BusError, match='out of range'):
        handler.write(1, 8, b'\x09')
    assert handler.read(1, 132, 4).data == (2048).to_bytes(4, 'little')


def test_data_that_look_like_a_header_arrive(handler):
    with pytest.raises(BusError, match='out of range'):
        handler.write(1, 116, (0x00FDFFFF).to_bytes(4, 'little'))
    data = GOAL_CURRENT.encode(-1) + GOAL_VELOCITY.encode(253)
    handler.port.send(sync_write_request(GOAL_CURRENT.address, 6, {1: data}))
    assert handler.read_register(1, GOAL_CURRENT) == -1
    assert handler.read_register(1, GOAL_VELOCITY) == 253


@pytest.mark.parametrize(
    'fault', [{'delay_s': PATIENT_MARGIN_S + 0.04, 'delayed': 2}, {'repeated': 4}]
)
def test_an_answer_of_another_time_is_not_the_value_of_another_register(line, handler, fault):
    with line.paused() as faults:
        for name, value in fault.items():
            setattr(faults, name, value)
    for _ in range(3):
        assert handler.read_register(1, RETURN_DELAY_TIME) == 250
        assert handler.read_register(1, OPERATING_MODE) == 3
        assert handler.read_register(1, BAUD_RATE) == 3


def test_the_alert_bit_is_kept_with_the_value(line, handler):
    line.overload(1)
    reply = handler.read(1, 132, 4)
    assert reply.error == ALERT
    assert reply.data == (2048).to_bytes(4, 'little')


@pytest.mark.parametrize(('marked', 'kind'), [((), Kind.REAL), ((2,), Kind.EMULATED)])
def test_only_servos_without_the_mark_of_an_emulator_are_real(marked, kind):
    unmarked = MODEL_INFORMATION.initial
    servos = [
        EmulatedServo(device) if device in marked else EmulatedServo(device, information=unmarked)
        for device in (1, 2)
    ]
    with EmulatedBus(servos) as bus:
        motors = opened(BusSettings(bus.port), MOUNTS)
        try:
            assert motors.kind is kind
        finally:
            motors.close()

"""The doctor's report on servos on a line that loses packets."""

import pytest

from endoscope_devices.dynamixel.doctor import examine
from endoscope_emulators.dynamixel.bus import EmulatedBus
from endoscope_emulators.dynamixel.servo import EmulatedServo


@pytest.fixture
def bus():
    with EmulatedBus([EmulatedServo(device) for device in (1, 2)]) as bus:
        yield bus


def spoil(bus, share):
    with bus.paused() as faults:
        faults.damage_rate = share


def test_a_lost_reply_is_asked_for_again(bus):
    spoil(bus, 0.1)
    found = [servo for _ in range(3) for servo in examine(bus.port, [1_000_000]).servos]
    assert len(found) >= 2
    assert {(servo.voltage, servo.temperature) for servo in found if servo.complete} == {(12.0, 30)}
    assert any(servo.complete for servo in found)


def test_a_missing_reading_is_not_reported_as_zero(bus):
    spoil(bus, 0.4)
    finding = examine(bus.port, [1_000_000])
    while not any(not servo.complete for servo in finding.servos):
        finding = examine(bus.port, [1_000_000])
    assert 'answers a ping; not all of its registers could be read' in str(finding)
    assert ' 0.0 V' not in str(finding)
    assert not any('supply' in line for line in finding.advice)

"""The bus thread over a real terminal while the line, the servos or the node fail."""

import time

import pytest
from patient_clients import PATIENCE_S, opened

from endoscope_devices.dynamixel.settings import BusSettings, ServoMount
from endoscope_emulators.dynamixel.process import EmulatorProcess

MOUNTS = (ServoMount('motor_x', 1), ServoMount('motor_y', 2))
FASTEST = 4.9


class Rig:
    """Two motors that swing, and what was read of them."""

    def __init__(self, tmp_path):
        self.emulator = EmulatorProcess(link=tmp_path / 'servos')
        self.motors = opened(BusSettings(self.emulator.port), MOUNTS)
        self.readings = []
        self.began = time.monotonic()

    @property
    def bus(self):
        return self.motors.bus

    def swing_until(self, condition):
        deadline = time.monotonic() + PATIENCE_S
        goal = 0.0
        while not condition():
            assert time.monotonic() < deadline, (self.motors.trouble(), self.motors.health())
            self.motors.exchange((goal, -goal), 1)
            newest = self.bus.newest
            if newest is not None and (not self.readings or newest is not self.readings[-1]):
                self.readings.append(newest)
            goal += 0.002
            goal = goal if goal < 1.0 else -1.0
            time.sleep(1e-3)

    def swing(self, seconds):
        end = time.monotonic() + seconds
        self.swing_until(lambda: time.monotonic() >= end)

    def arm(self):
        """Enable as often as it takes: a stall of the machine is a fault like any other."""
        asked = 0.0

        def armed():
            nonlocal asked
            if not self.bus.armed and time.monotonic() - asked > 1.0:
                asked = time.monotonic()
                self.motors.set_torque(True)
            return self.bus.armed

        self.swing_until(armed)

    def check_readings(self):
        """Every reading is what the servo did at the time that the reading says."""
        for motor, device in enumerate((1, 2)):
            trace = self.emulator.do('trace', device, self.began - 1.0)
            times = [t for t, _ in trace]
            first = times[0]
            for timed in self.readings:
                k = round((timed.taken_ns * 1e-9 - first) / 1e-3)
                around = [p for _, p in trace[max(0, k - 3) : k + 4]]
                assert around
                value = MOUNTS[motor].servo(timed.reading.position[motor])
                slack = 2e-3 + FASTEST * 2e-3
                assert min(around) - slack <= value <= max(around) + slack

    def close(self):
        self.motors.close()
        self.emulator.close()


@pytest.fixture
def rig(tmp_path):
    rig = Rig(tmp_path)
    rig.arm()
    rig.swing(0.2)
    yield rig
    rig.close()


@pytest.mark.nightly
def test_flipped_bits_make_no_wrong_reading(rig):
    rig.emulator.do('damage_rate', 0.03)
    rig.swing_until(lambda: sum(rig.bus.figures.failures.values()) > 10 and len(rig.readings) > 300)
    rig.check_readings()


@pytest.mark.nightly
@pytest.mark.parametrize('late', [0.006, 0.05])
def test_late_answers_are_not_taken_for_those_of_the_next_request(rig, late):
    rig.emulator.do('delay_s', late)
    rig.emulator.do('delayed', 12)
    rig.swing(0.5)
    assert sum(rig.bus.figures.failures.values()) > 0
    before = len(rig.readings)
    rig.swing_until(lambda: len(rig.readings) - before > 50)
    rig.check_readings()


@pytest.mark.nightly
def test_repeated_answers_change_nothing(rig):
    rig.emulator.do('repeated', 400)
    rig.swing_until(lambda: len(rig.readings) > 300)
    rig.check_readings()


def stopped(rig, since):
    """The last positions of the first servo do not differ."""
    track = [p for _, p in rig.emulator.do('trace', 1, since)]
    return max(track[-50:]) - min(track[-50:]) < 2e-3


def test_a_servo_that_is_cut_off_disarms_and_comes_back_without_moving(rig):
    rig.emulator.do('silence', 1)
    rig.swing_until(lambda: 'no valid reading' in rig.motors.trouble())
    assert not rig.bus.armed
    # What was answered before may still be on its way.
    rig.swing(0.1)
    before = rig.bus.figures.readings
    rig.swing(0.1)
    assert rig.bus.figures.readings == before
    rig.emulator.do('silence')
    rig.swing_until(lambda: rig.bus.figures.readings > before + 100)
    since = time.monotonic()
    rig.swing(0.3)
    assert stopped(rig, since)
    assert not rig.bus.armed
    rig.arm()
    rig.check_readings()


def test_an_order_given_while_the_bus_is_away_is_not_carried_out_later(rig):
    rig.emulator.do('hang_up')
    rig.swing_until(lambda: 'there is no such port' in rig.motors.trouble())
    rig.motors.set_torque(True)
    rig.emulator.do('plug_in')
    before = rig.bus.figures.readings
    rig.swing_until(lambda: rig.bus.figures.readings > before + 200)
    assert not rig.bus.armed
    assert rig.emulator.state(1)['torque'] == 0
    rig.arm()


def test_a_servo_that_loses_power_gives_no_false_zero(rig):
    rig.emulator.do('supply', 2, 5.0)
    rig.swing(0.05)
    rig.emulator.do('supply', 2, 12.0)
    rig.swing_until(lambda: not rig.bus.armed)
    before = rig.bus.figures.readings
    rig.swing_until(lambda: rig.bus.figures.readings > before + 100)
    assert rig.emulator.state(2)['watchdog'] == 5
    assert rig.emulator.state(2)['torque'] == 0
    assert not rig.bus.armed
    rig.check_readings()


@pytest.mark.nightly
def test_an_overload_is_named_and_ends_only_with_a_restart(rig):
    rig.emulator.do('overload', 1)
    rig.swing_until(lambda: 'servo 1 reports overload' in rig.motors.trouble())
    assert not rig.bus.armed
    assert 'hardware error' in rig.motors.health()['motor_x: error']
    rig.motors.set_torque(True)
    rig.swing_until(lambda: 'restart it' in rig.motors.trouble())
    assert not rig.bus.armed
    rig.motors.reboot()
    rig.swing_until(lambda: rig.emulator.state(1)['hardware'] == 0)
    rig.swing_until(lambda: rig.motors.trouble() == '')
    assert not rig.bus.armed
    rig.arm()


@pytest.mark.nightly
def test_a_brown_out_is_named(rig):
    rig.emulator.do('supply', 1, 9.0)
    rig.swing_until(lambda: 'servo 1 reports input voltage' in rig.motors.trouble())
    assert not rig.bus.armed


def test_a_node_that_no_longer_renews_its_goal_is_noticed(rig):
    deadline = time.monotonic() + PATIENCE_S
    # On a busy machine a servo may fall silent first.
    while 'has not renewed its goal' not in rig.motors.trouble():
        assert time.monotonic() < deadline, rig.motors.trouble()
        rig.arm()
        since = time.monotonic()
        while rig.bus.armed:
            assert time.monotonic() < deadline
            time.sleep(1e-3)
    time.sleep(0.4)
    assert stopped(rig, since)
    assert rig.emulator.state(1)['torque'] == 1


@pytest.mark.nightly
def test_the_current_limit_of_the_firmware_stops_a_shaft(tmp_path):
    with EmulatorProcess(stiffness=2.0) as emulator:
        motors = opened(BusSettings(emulator.port, current_limit=0.3), MOUNTS)
        try:
            motors.set_torque(True)
            reach, effort = 0.0, 0.0
            end = time.monotonic() + 0.8
            while time.monotonic() < end:
                reading = motors.exchange((0.8, 0.0), 1)
                if reading is not None:
                    reach = max(reach, reading.position[0])
                    effort = max(effort, reading.effort[0])
                time.sleep(1e-3)
        finally:
            motors.close()
    limit = 0.3 * 4.1 / 2.3
    assert 0.9 * limit < effort <= limit
    assert reach < 1.1 * limit / 2.0

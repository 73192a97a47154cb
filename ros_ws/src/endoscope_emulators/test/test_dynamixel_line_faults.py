"""The bus thread over a real terminal while the line, the servos or the node fail."""

import time

import pytest
from patient_clients import PATIENCE_S, opened

from endoscope_devices.dynamixel.bring_up import BusSettings, ServoMount
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

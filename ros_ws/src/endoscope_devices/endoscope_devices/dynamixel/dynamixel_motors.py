"""A bus of Dynamixel servos behind the interface of the motor driver."""

import dataclasses
import time
from collections.abc import Sequence

from endoscope_core.rig import Kind
from endoscope_devices.device import MotorReading
from endoscope_devices.dynamixel.bring_up import BusSettings, ServoMount
from endoscope_devices.dynamixel.bus_thread import BusThread, TimedReading
from endoscope_devices.dynamixel.control_table import error_in_words


class DynamixelMotors:
    """J servos on a serial port, in the order of the motors, run by a thread of their own."""

    def __init__(self, settings: BusSettings, mounts: Sequence[ServoMount]) -> None:
        self.names = tuple(mount.name for mount in mounts)
        self.bus = BusThread(settings, mounts)
        self._given: TimedReading | None = None

    @property
    def kind(self) -> Kind:
        """Emulated if any of the servos is."""
        emulated = any(health.emulated for health in self.bus.health)
        return Kind.EMULATED if emulated else Kind.REAL

    def open(self) -> None:
        """Open the port and set the servos up; see :meth:`BusThread.start`."""
        self.bus.start()

    def set_torque(self, on: bool) -> None:
        """Arm the bus and switch torque on, or switch it off."""
        self.bus.set_torque(on)

    def reboot(self) -> None:
        """Restart the servos, with torque off: the only way out of their own shutdown."""
        self.bus.reboot()

    def exchange(self, goal: Sequence[float], periods: int) -> MotorReading | None:
        """Renew the goal, and give the newest reading unless it was given before."""
        self.bus.set_goal(goal)
        newest = self.bus.newest
        if newest is None or newest is self._given:
            return None
        self._given = newest
        age = (time.monotonic_ns() - newest.taken_ns) * 1e-9
        return dataclasses.replace(newest.reading, age=age)

    def trouble(self) -> str:
        """Error of the bus or of a servo."""
        return self.bus.trouble()

    def health(self) -> dict[str, object]:
        """Figures of the bus for diagnostics."""
        bus = self.bus
        figures = bus.figures
        values: dict[str, object] = {
            'port': bus.settings.port,
            'baud': bus.settings.baud,
            'armed': bus.armed,
            'age of the reading [ms]': bus.age() * 1e3,
            'cycles': figures.cycles,
            'readings': figures.readings,
            'last failure': figures.last_failure,
        }
        values |= {f'failures: {reason}': n for reason, n in sorted(figures.failures.items())}
        for mount, health in zip(bus.mounts, bus.health, strict=True):
            values[f'{mount.name}: servo'] = f'{health.model}, id {mount.device}'
            values[f'{mount.name}: error'] = error_in_words(health.error)
            values[f'{mount.name}: hardware error'] = health.hardware
            values[f'{mount.name}: voltage [V]'] = health.voltage
            values[f'{mount.name}: temperature [degC]'] = health.temperature
        return values

    def close(self) -> None:
        """Switch torque off if that is still possible, and close the port."""
        self.bus.stop()

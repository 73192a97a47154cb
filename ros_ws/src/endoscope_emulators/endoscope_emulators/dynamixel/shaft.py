"""How an emulated servo's shaft follows its goal."""

import math
from dataclasses import dataclass

from endoscope_devices.dynamixel.control_table import MODELS


@dataclass
class FirstOrderShaft:
    """A shaft that closes on its goal exponentially, against a spring, as far as current allows.

    ``x' = (goal - x) / time_constant``, no faster than the motor without load; it stops where the
    spring needs more than the allowed current. Without torque it stays where it is, for the gear
    holds it.
    """

    position: float = math.pi  # rad
    velocity: float = 0.0  # rad/s
    time_constant: float = 0.06  # s; the simulated plant's servo lag
    stiffness: float = 0.2  # of the spring about ``rest``, N m/rad
    rest: float = math.pi  # where the spring pulls to, rad
    max_speed: float = MODELS[1020].no_load_speed  # rad/s
    torque_constant: float = MODELS[1020].torque_constant  # N m/A

    def advance(self, goal: float | None, limit: float, dt: float) -> float:
        """Move for dt s to a goal in rad (None: no torque), within a limit in A; current in A."""
        if goal is None:
            self.velocity = 0.0
            return 0.0
        reach = self.max_speed * dt
        step = (goal - self.position) * -math.expm1(-dt / self.time_constant)
        there = self.position + min(reach, max(-reach, step))
        if self.stiffness > 0.0:
            far = limit * self.torque_constant / self.stiffness
            there = min(self.rest + far, max(self.rest - far, there))
        self.velocity = (there - self.position) / dt
        self.position = there
        return self.stiffness * (there - self.rest) / self.torque_constant

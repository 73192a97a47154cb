"""How a Dynamixel bus and its servos are to be set up."""

import math
from dataclasses import dataclass

from endoscope_devices.device import DeviceError
from endoscope_devices.dynamixel.control_table import (
    BUS_WATCHDOG,
    CURRENT_LIMIT,
    CURRENT_UNIT,
    RETURN_DELAY_UNIT,
    WATCHDOG_UNIT,
)


@dataclass(frozen=True)
class ServoMount:
    """How a servo is built in."""

    name: str  # of its motor
    device: int  # its id on the bus
    direction: int = 1  # 1, or -1 where the shaft's positive sense is the servo's negative one
    zero: float = math.pi  # servo angle in rad at which the shaft is at 0

    def shaft(self, servo: float) -> float:
        """Shaft angle of a servo angle, in rad."""
        return self.direction * (servo - self.zero)

    def servo(self, shaft: float) -> float:
        """Servo angle of a shaft angle, in rad."""
        return self.zero + self.direction * shaft


@dataclass(frozen=True)
class BusSettings:
    """Settings of the bus."""

    port: str  # device file
    baud: int = 1_000_000  # bit/s
    current_limit: float = 0.5  # A at which the servos' firmware limits the tension of the wires
    # Silence in s after which a servo stops by itself; a multiple of 20 ms is taken.
    watchdog: float = 0.1
    return_delay: float = 0.0  # s that a servo waits before it answers
    rate: float = 1000.0  # cycles per second at most; 0 for as many as the bus carries
    # Time in s after which a goal that nobody renewed is given up and the measured position held.
    goal_timeout: float = 0.1
    # Silence of a servo in s after which motion is refused until it is enabled again.
    fault_after: float = 0.05

    def __post_init__(self) -> None:
        for register, counts in (
            (BUS_WATCHDOG, self.watchdog_counts),
            (CURRENT_LIMIT, self.current_counts),
        ):
            largest = register.high or 0
            if not 1 <= counts <= largest:
                unit, scale = register.unit, register.scale
                raise DeviceError(
                    f'{register.name} of {counts * scale:g} {unit} is not possible; give '
                    f'{scale:g} to {largest * scale:g} {unit}'
                )

    @property
    def watchdog_counts(self) -> int:
        """Value of Bus Watchdog(98)."""
        return math.ceil(self.watchdog / WATCHDOG_UNIT - 1e-9)

    @property
    def current_counts(self) -> int:
        """Value of Current Limit(38), never more than was asked for."""
        return int(self.current_limit / CURRENT_UNIT + 1e-9)

    @property
    def return_delay_counts(self) -> int:
        """Value of Return Delay Time(9)."""
        return round(self.return_delay / RETURN_DELAY_UNIT)

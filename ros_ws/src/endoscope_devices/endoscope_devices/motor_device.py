"""What a motor driver node needs of a servo bus, simulated or real."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from endoscope_core.errors import EndoscopeError


class DeviceError(EndoscopeError, RuntimeError):
    """A device cannot be opened or is set up wrongly; the message says what to do."""


@dataclass(frozen=True)
class MotorReading:
    """Newest valid state of J motor shafts."""

    position: tuple[float, ...]  # rad, (J,)
    velocity: tuple[float, ...]  # rad/s, (J,)
    effort: tuple[float, ...]  # N m, (J,)
    age: float = 0.0  # s since it was measured


class MotorDevice(Protocol):
    """A set of servos in position mode.

    A real bus runs in a thread of its own; :meth:`exchange` hands over the newest goal, takes the
    newest reading, and never waits.
    """

    names: tuple[str, ...]

    def open(self) -> None:
        """Connect and check the settings; DeviceError where not reachable, or set up wrongly."""

    def set_torque(self, on: bool) -> None:
        """Let the servos hold where they are and then follow goals, or let them go.

        Switching torque on is what ends the refusal of goals after a trouble; nothing else does.
        """

    def exchange(self, goal: Sequence[float], periods: int) -> MotorReading | None:
        """Set the goal (J,) in rad and give the newest valid reading; None while none is new.

        The goal is the newest command; `periods` are control periods (1 ms) since the last call.
        """

    def trouble(self) -> str:
        """What forbids motion now, empty if nothing; asked for in every tick."""

    def health(self) -> dict[str, object]:
        """Figures for diagnostics."""

    def close(self) -> None:
        """Let go of the device."""

"""What the thread of a bus tells others: the newest reading, counts, each servo's state."""

from collections import Counter
from dataclasses import dataclass, field

from endoscope_devices.motor_device import MotorReading


@dataclass(frozen=True)
class TimedReading:
    """A reading of all shafts."""

    reading: MotorReading
    taken_ns: int  # our monotonic time in ns at which the oldest of it was taken


@dataclass
class ServoHealth:
    """What is known of a servo beside its motion."""

    model: str = ''
    error: int = 0  # error byte of its last answer
    hardware: str = ''  # errors in words
    voltage: float = 0.0  # V, as last read
    temperature: int = 0  # °C, as last read


@dataclass
class BusFigures:
    """What the thread counts."""

    cycles: int = 0
    readings: int = 0  # cycles that gave a new reading of all servos
    failures: Counter[str] = field(default_factory=Counter)  # failed cycles by reason
    last_failure: str = ''  # in words
    last_ns: int = 0  # monotonic time in ns of the last valid reading

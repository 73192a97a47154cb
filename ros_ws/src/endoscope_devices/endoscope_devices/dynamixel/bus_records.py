"""What the thread of a bus tells others: the newest reading, counts, each servo's state."""

from collections import Counter
from dataclasses import dataclass, field

from endoscope_devices.motor_device import MotorReading


@dataclass(frozen=True)
class TimedReading:
    """A reading of all shafts.

    `reading`: what was measured.
    `taken_ns`: our monotonic time in ns at which the oldest of it was taken.
    """

    reading: MotorReading
    taken_ns: int


@dataclass
class ServoHealth:
    """What is known of a servo beside its motion.

    `model`: its name.
    `error`: error byte of its last answer.
    `hardware`: hardware errors in words.
    `voltage`, `temperature`: v and °C, as last read.
    """

    model: str = ''
    error: int = 0
    hardware: str = ''
    voltage: float = 0.0
    temperature: int = 0


@dataclass
class BusFigures:
    """What the thread counts.

    `cycles`, `readings`: cycles run, and those that gave a new reading of all servos.
    `failures`: failed cycles by reason.
    `last_failure`: the last one in words.
    `last_ns`: monotonic time in ns of the last valid reading.
    """

    cycles: int = 0
    readings: int = 0
    failures: Counter[str] = field(default_factory=Counter)
    last_failure: str = ''
    last_ns: int = 0

"""What can go wrong on an emulated line."""

from dataclasses import dataclass, field
from random import Random


@dataclass
class LineFaults:
    """Faults in force on a line."""

    silent: set[int] = field(default_factory=set)  # ids of servos whose cable is out
    damage_rate: float = 0.0  # share of packets, both ways, in which bits are flipped
    bits: int = 3  # at most in each of them
    delay_s: float = 0.0  # by which the next answers are late
    delayed: int = 0  # how many they are
    repeated: int = 0  # how many of the next answers are sent twice
    chance: Random = field(default_factory=lambda: Random(1))

    def damaged(self, packet: bytes) -> bytes:
        """Return the packet, perhaps with flipped bits."""
        if self.chance.random() >= self.damage_rate:
            return packet
        hurt = bytearray(packet)
        for _ in range(self.chance.randint(1, self.bits)):
            hurt[self.chance.randrange(len(hurt))] ^= 1 << self.chance.randrange(8)
        return bytes(hurt)

    def delay(self) -> float:
        """Delay of the next answer in s."""
        if self.delayed <= 0:
            return 0.0
        self.delayed -= 1
        return self.delay_s

    def repeats(self) -> int:
        """How often the next answer is sent."""
        if self.repeated <= 0:
            return 1
        self.repeated -= 1
        return 2

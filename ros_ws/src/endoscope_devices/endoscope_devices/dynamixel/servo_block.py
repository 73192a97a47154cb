"""What is read from every servo in every cycle, and whether it can be true."""

import struct
from dataclasses import dataclass

from endoscope_devices.dynamixel.control_table import (
    BUS_WATCHDOG,
    COUNT,
    CURRENT_UNIT,
    INDIRECT_ADDRESS,
    INDIRECT_DATA,
    PRESENT_CURRENT,
    REALTIME_TICK,
    VELOCITY_UNIT,
)
from endoscope_devices.dynamixel.tick_clock import Freshness, TickClock

# Present current, velocity and position are ten contiguous bytes. The bus watchdog says whether the
# servo has stopped by itself, and is a canary: a servo that restarted has lost its indirect
# addresses, and then every byte of the block reads 0, which would be a position.
_MAPPED = (
    *range(REALTIME_TICK.address, REALTIME_TICK.address + REALTIME_TICK.size),
    BUS_WATCHDOG.address,
    *range(PRESENT_CURRENT.address, PRESENT_CURRENT.address + 10),
)
_LAYOUT = struct.Struct('<Hbhii')

BLOCK_ADDRESS = INDIRECT_DATA
BLOCK_SIZE = len(_MAPPED)
MAP_ADDRESS = INDIRECT_ADDRESS
MAP_BYTES = struct.pack(f'<{BLOCK_SIZE}H', *_MAPPED)

JITTER = 0.02


@dataclass(frozen=True)
class ServoBlock:
    """One reading of a servo, in the servo's own direction and zero."""

    tick: int  # Realtime Tick(120), ms
    watchdog: int  # Bus Watchdog(98)
    current: float  # A
    velocity: float  # rad/s
    position: float  # rad


def decode_block(data: bytes) -> ServoBlock:
    """Take the ``BLOCK_SIZE`` bytes of a block apart."""
    tick, watchdog, current, velocity, position = _LAYOUT.unpack(data)
    return ServoBlock(
        tick, watchdog, current * CURRENT_UNIT, velocity * VELOCITY_UNIT, position * COUNT
    )


class BlockJudge:
    """Decides whether a block of one servo is a true reading taken for this request.

    A CRC of 16 bits lets one in 65536 arbitrary damages through. What remains must also carry a
    tick that fits our clock, the watchdog as it was set, and a shaft that moved no faster than
    `max_speed` (rad/s) with no more than `max_current` (A).
    """

    def __init__(self, max_speed: float, max_current: float) -> None:
        self.clock = TickClock()
        self._max_speed = max_speed
        self._max_current = max_current
        self._last: ServoBlock | None = None
        self._last_ns = 0

    def forget(self) -> None:
        """Take the next block as it is: after the servo was set up."""
        self.clock.forget()
        self._last = None

    def judge(
        self, block: ServoBlock, watchdog: int, asked_ns: int, received_ns: int
    ) -> tuple[Freshness | None, str]:
        """Freshness of one block, or None and why it is refused.

        `watchdog` is what Bus Watchdog(98) was set to; `asked_ns` and `received_ns` are our
        monotonic time in ns before the request and after the answer.
        """
        if block.watchdog not in (watchdog, -1):
            return None, 'has lost its settings: it has restarted'
        if self._last is not None:
            elapsed = (received_ns - self._last_ns) * 1e-9
            reach = self._max_speed * elapsed + JITTER
            if abs(block.position - self._last.position) > reach:
                moved = abs(block.position - self._last.position)
                return None, f'cannot have moved by {moved:.3g} rad in {elapsed * 1e3:.1f} ms'
        if abs(block.velocity) > self._max_speed or abs(block.current) > self._max_current:
            return None, (f'cannot turn at {block.velocity:.3g} rad/s with {block.current:.3g} A')
        freshness = self.clock.judge(block.tick, asked_ns, received_ns)
        if freshness not in (Freshness.NEW, Freshness.SAME_TICK):
            return None, f'sent a reading {freshness.value}'
        if freshness is Freshness.NEW:
            self._last = block
            self._last_ns = received_ns
        return freshness, ''

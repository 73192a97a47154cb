"""The block read from every servo in every cycle, and its check for plausibility and freshness."""

import struct
from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import NamedTuple

from endoscope_devices.dynamixel.control_table import (
    BUS_WATCHDOG,
    COUNT,
    CURRENT_UNIT,
    INDIRECT_ADDRESS,
    INDIRECT_DATA,
    PRESENT_CURRENT,
    REALTIME_TICK,
    TICK_PERIOD,
    VELOCITY_UNIT,
)

_MS = 1_000_000
# Present current, velocity and position are ten contiguous bytes. The bus watchdog shows that the
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


class Freshness(Enum):
    """Verdict of the tick on a reading."""

    NEW = 'new'
    SAME_TICK = 'same tick'
    OLD = 'taken before it was asked for'
    AHEAD = 'from a clock that jumped'


_DRIFT = 0.01  # rate error of the clocks at most; one without a crystal keeps 1 %


class TickClock:
    """Keeps the offset between a servo's clock and ours as an interval, and judges ticks by it.

    Every true reading was taken between request and receipt, which bounds the offset to an interval
    as wide as the exchange took, plus the millisecond that the tick is long (e-manual 'Realtime
    Tick(120)': 0 to 32767 ms, then 0 again). The intervals of true readings always overlap, up to
    the drift between the clocks; that of a late answer, or of a counter that stands still, lies
    above them, and that of a counter that began anew lies anywhere.
    """

    def __init__(self) -> None:
        self._low_ns = 0
        self._high_ns = 0
        self._tick = -1
        self._seen_ns = 0

    def judge(self, tick: int, asked_ns: int, received_ns: int) -> Freshness:
        """Judge the tick of a reading by steady ns of request and answer; a new one moves it."""
        if self._tick < 0 or received_ns - self._seen_ns > TICK_PERIOD * _MS // 4:
            self._set(tick, received_ns)
            self._low_ns = asked_ns - (tick + 1) * _MS
            self._high_ns = received_ns - tick * _MS
            return Freshness.NEW
        slack = int((received_ns - self._seen_ns) * _DRIFT) + _MS // 5
        turns = round((received_ns - self._high_ns - tick * _MS) / (TICK_PERIOD * _MS))
        elapsed_ns = (tick + turns * TICK_PERIOD) * _MS
        low = max(self._low_ns - slack, asked_ns - elapsed_ns - _MS)
        high = min(self._high_ns + slack, received_ns - elapsed_ns)
        if low > high:
            return Freshness.OLD if asked_ns - elapsed_ns > self._high_ns else Freshness.AHEAD
        if tick == self._tick:
            return Freshness.SAME_TICK
        self._low_ns, self._high_ns = low, high
        self._set(tick, received_ns)
        return Freshness.NEW

    def taken_ns(self, tick: int) -> int:
        """Our monotonic time in ns at which a tick that was judged new began."""
        middle = (self._low_ns + self._high_ns) // 2
        turns = round((self._seen_ns - middle - tick * _MS) / (TICK_PERIOD * _MS))
        return middle + (tick + turns * TICK_PERIOD) * _MS

    def _set(self, tick: int, received_ns: int) -> None:
        self._tick = tick
        self._seen_ns = received_ns


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


class Failure(StrEnum):
    """Why a cycle gives no reading, as the diagnostics count it."""

    NO_ANSWER = 'no answer'
    REFUSED = 'refused'
    RESTARTED = 'restarted'
    NOT_CREDIBLE = 'not credible'


class Doubt(NamedTuple):
    """Why a reading is not taken."""

    failure: Failure
    words: str  # to stand behind ``servo 1``


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

    def judge(
        self, block: ServoBlock, watchdog: int, asked_ns: int, received_ns: int
    ) -> Freshness | Doubt:
        """Judge one block by Bus Watchdog(98) as set and by steady ns of request and answer."""
        if block.watchdog not in (watchdog, -1):
            return Doubt(Failure.RESTARTED, 'has lost its settings: it has restarted')
        if self._last is not None:
            elapsed = (received_ns - self._last_ns) * 1e-9
            farthest = self._max_speed * elapsed + JITTER
            if abs(block.position - self._last.position) > farthest:
                moved = abs(block.position - self._last.position)
                return _incredible(
                    f'cannot have moved by {moved:.3g} rad in {elapsed * 1e3:.1f} ms'
                )
        if abs(block.velocity) > self._max_speed or abs(block.current) > self._max_current:
            return _incredible(
                f'cannot turn at {block.velocity:.3g} rad/s with {block.current:.3g} A'
            )
        freshness = self.clock.judge(block.tick, asked_ns, received_ns)
        if freshness not in (Freshness.NEW, Freshness.SAME_TICK):
            return _incredible(f'sent a reading {freshness.value}')
        if freshness is Freshness.NEW:
            self._last = block
            self._last_ns = received_ns
        return freshness


def _incredible(words: str) -> Doubt:
    return Doubt(Failure.NOT_CREDIBLE, words)

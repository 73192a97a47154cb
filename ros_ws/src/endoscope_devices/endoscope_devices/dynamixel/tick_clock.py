"""Tells from a servo's own millisecond counter whether a reading was taken for this request."""

from enum import Enum

from endoscope_devices.dynamixel.control_table import TICK_PERIOD

_MS = 1_000_000


class Freshness(Enum):
    """What the tick says of a reading."""

    NEW = 'new'
    SAME_TICK = 'same tick'
    OLD = 'taken before it was asked for'
    AHEAD = 'from a clock that jumped'


class TickClock:
    """Keeps the offset between a servo's clock and ours as an interval, and judges ticks by it.

    Every true reading was taken between request and receipt, which bounds the offset to an interval
    as wide as the exchange took, plus the millisecond that the tick is long (e-manual 'Realtime
    Tick(120)': 0 to 32767 ms, then 0 again). The intervals of true readings always overlap, up to
    the drift between the clocks; that of a late answer, or of a counter that stands still, lies
    above them, and that of a counter that began anew lies anywhere.
    """

    def __init__(self, drift: float = 0.01) -> None:
        self._drift = drift  # rate error of the clocks at most; one without a crystal keeps 1 %
        self._low_ns = 0
        self._high_ns = 0
        self._tick = -1
        self._seen_ns = 0

    def forget(self) -> None:
        """Take the next tick as it is: after a restart of the servo or a long silence."""
        self._tick = -1

    def judge(self, tick: int, asked_ns: int, received_ns: int) -> Freshness:
        """Judge the tick of a reading; only a new one moves the clock.

        `asked_ns` and `received_ns` are our monotonic time in ns just before the request was sent
        and just after the answer came.
        """
        if self._tick < 0 or received_ns - self._seen_ns > TICK_PERIOD * _MS // 4:
            self._set(tick, received_ns)
            self._low_ns = asked_ns - (tick + 1) * _MS
            self._high_ns = received_ns - tick * _MS
            return Freshness.NEW
        slack = int((received_ns - self._seen_ns) * self._drift) + _MS // 5
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

"""Which ticks a slower sensor samples at."""


class SampleClock:
    """Samples at the first tick in each sampling period of a rate, counted from the epoch.

    The choice depends on the stamp alone, so that whoever knows the rate knows which stamps to
    expect.

    `rate`: in Hz; a rate above that of the ticks samples at every tick.
    """

    def __init__(self, rate: float) -> None:
        self._period_ns = round(1e9 / rate)
        self._last = -1

    def due(self, stamp_ns: int) -> bool:
        """Whether the tick stamped so is one to sample at; call it for each tick in turn."""
        number = stamp_ns // self._period_ns
        if number == self._last:
            return False
        self._last = number
        return True

"""Which ticks a slower sensor samples at."""


class SampleClock:
    """Samples at the first tick in each sampling period of a rate in Hz, counted from the epoch."""

    def __init__(self, rate: float) -> None:
        self._period_ns = round(1e9 / rate)
        self._last = -1

    def due(self, stamp_ns: int) -> bool:
        """Whether the tick stamped so is one to sample at; call it for each tick in turn."""
        # By the stamp alone: whoever knows the rate knows which stamps to expect.
        number = stamp_ns // self._period_ns
        if number == self._last:
            return False
        self._last = number
        return True

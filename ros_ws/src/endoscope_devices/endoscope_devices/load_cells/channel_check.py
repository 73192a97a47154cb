"""Detects broken, saturated, frozen and spiking load cells."""

import math
from collections import deque

from endoscope_devices.load_cells.calibration_file import FaultLimits, WireCell

# So many good readings in a row end a fault, and so many consistent ones make a step a new level.
CONFIRMATIONS = 3
_SPIKES = 5
_SPIKES_WITHIN_NS = 1_000_000_000


class ChannelCheck:
    """Judges each reading of one cell.

    Broken: the count is not a number, or beyond ``broken_below`` and ``broken_above``, where only
    an open bridge drives the amplifier. Saturated: beyond ``saturated_*``. Frozen: not one count of
    change for ``frozen_after`` seconds; the noise of a working cell changes its last digit.
    Spiking: a change faster than ``spike_rate``; three consistent readings in a row are a new
    level. With five spikes in a second the whole channel is rejected. An old reply of Modbus RTU,
    which has no transaction number, is detected only here: delayed and sent again, it is dropped
    where the tension has changed by more than a wire can in one interval.
    """

    def __init__(self, wire: str, cell: WireCell, limits: FaultLimits) -> None:
        self._wire = wire
        self._limits = limits
        self.cell = cell
        self.fault = ''  # what is wrong, naming the wire; empty while readings are good
        self.spikes = 0  # readings that changed too fast
        self.new_levels = 0  # how often three of them were taken for a new level
        self._good = 0
        self._spiked_ns: deque[int] = deque(maxlen=_SPIKES)
        self._count = math.nan
        self._changed_ns = 0
        self._level = math.nan
        self._level_ns = 0
        self._candidate = math.nan
        self._candidate_ns = 0
        self._agreeing = 0

    def read(self, time_ns: int, count: float) -> float | None:
        """Take a count at a monotonic time in ns; give the tension in N where it can be believed.

        None during a fault, and for its first ``CONFIRMATIONS - 1`` good readings after.
        """
        trouble = self._trouble(time_ns, count)
        if trouble:
            self.fault = f'{self._wire}: {trouble}'
            self._good = 0
            return None
        self._good += 1
        if self.fault:
            if self._good < CONFIRMATIONS:
                return None
            self.fault = ''
        return self.cell.tension(count)

    def _trouble(self, time_ns: int, count: float) -> str:
        limits = self._limits
        if not math.isfinite(count) or not limits.broken_below < count < limits.broken_above:
            return f'broken wire of the cell ({count:.6g} counts)'
        if not limits.saturated_below < count < limits.saturated_above:
            return f'saturated ({count:.6g} counts)'
        if count != self._count:
            self._count = count
            self._changed_ns = time_ns
        still = (time_ns - self._changed_ns) * 1e-9
        if 0.0 < limits.frozen_after <= still:
            return f'frozen ({count:.6g} counts for {still:.1f} s)'
        jump = self._jump(time_ns, self.cell.tension(count))
        many = len(self._spiked_ns) == _SPIKES and (
            time_ns - self._spiked_ns[0] < _SPIKES_WITHIN_NS
        )
        return f'spiking ({_SPIKES} times within a second)' if many else jump

    def _jump(self, time_ns: int, tension: float) -> str:
        if math.isnan(self._level) or self._near(self._level, self._level_ns, tension, time_ns):
            self._take(time_ns, tension)
            return ''
        self.spikes += 1
        self._spiked_ns.append(time_ns)
        agrees = self._near(self._candidate, self._candidate_ns, tension, time_ns)
        self._agreeing = self._agreeing + 1 if agrees else 1
        self._candidate, self._candidate_ns = tension, time_ns
        if self._agreeing >= CONFIRMATIONS:
            self.new_levels += 1
            self._take(time_ns, tension)
            return ''
        return f'spiking (from {self._level:.2f} N to {tension:.2f} N)'

    def _near(self, before: float, before_ns: int, tension: float, time_ns: int) -> bool:
        allowed = self._limits.spike_noise + self._limits.spike_rate * (time_ns - before_ns) * 1e-9
        return abs(tension - before) <= allowed

    def _take(self, time_ns: int, tension: float) -> None:
        self._level, self._level_ns = tension, time_ns
        self._agreeing = 0
        self._candidate = math.nan

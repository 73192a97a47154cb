"""Where the samples of a sensor lie between simulated ticks, and what is averaged of them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class StampsOnTicks:
    """Raw samples between ticks, and the analysis samples that they make."""

    # (R,): place of each raw sample between simulated ticks `tick` and `tick + 1`.
    tick: Indices
    share: Array  # (R,), of the way from the one to the other
    first: Indices  # (M,), first raw sample of each analysis sample
    count: Array  # (M,), raw samples in each analysis sample

    def read(self, column: Array, lead: float = 0.0, skew: float = 0.0) -> Array:
        """Analysis samples (M,) of a simulated output (N,); see `Channel.predicted`."""
        if skew == 0.0:
            mean, rise = self._of_ticks
            rows = column[: mean.shape[1]]
            return np.asarray(mean @ rows + lead * (rise @ rows))
        place = (self.tick + self.share) / (1.0 + skew) + lead
        place = np.clip(place, 0.0, len(column) - 1.001)
        tick = place.astype(np.int64)
        left = column[tick]
        raw = left + (place - tick) * (column[tick + 1] - left)
        return np.asarray(np.add.reduceat(raw, self.first) / self.count)

    @cached_property
    def _of_ticks(self) -> tuple[csr_array, csr_array]:
        """Analysis samples from ticks (M, N), and by how much they rise over a tick."""
        sample = np.repeat(np.arange(len(self.first)), self.count.astype(np.int64))
        part = 1.0 / self.count[sample]
        shape = (len(self.first), int(self.tick.max()) + 2)

        def at(values: Array, ticks: Indices) -> csr_array:
            return csr_array((values, (sample, ticks)), shape)

        here, after = at(part, self.tick), at(part, self.tick + 1)
        late = at(part * self.share, self.tick + 1) - at(part * self.share, self.tick)
        return here + late, after - here

    def coarser(self, factor: int) -> 'StampsOnTicks':
        """The same samples between ticks that are longer by a factor."""
        if factor not in self._coarser:
            place = (self.tick + self.share) / factor
            tick = place.astype(np.int64)
            self._coarser[factor] = StampsOnTicks(tick, place - tick, self.first, self.count)
        return self._coarser[factor]

    @cached_property
    def _coarser(self) -> dict[int, 'StampsOnTicks']:
        return {}

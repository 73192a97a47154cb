"""What motion in free space leaves of a joint's plant, below which nothing is seen to touch it."""

import math

import numpy as np

from endoscope_core.tip_force.external_moment import BLOCK_TICKS, TICK_S

BLOCK_S = BLOCK_TICKS * TICK_S
COVERED = 0.95
"""Share of free motion in which zero lies within the bounds."""
FALSE_ALARM_S = 20.0 * 3600.0
"""Of motion in free space, in which one block may show as much as a force that is seen."""
TAIL = 0.1
"""Share of free motion that shows how rare larger misfits are."""
PRIOR_EXCESS, PRIOR_CLUSTERS = 0.09, 3.9
"""Mean excess over the level of that tail, in half-widths of a joint's set, and after how many
clusters a rig's own counts as much: by `endoscope bench touch --derive`, over rigs."""
LEAST = 100
"""Blocks of free motion, 2.5 s, from which bounds are known: ten in the tail."""
MOST = 24_000
"""Blocks that are learnt from, 10 min."""
_GROWN = 1.1
"""Blocks over those at which bounds were derived last, at which they are derived again."""


class FreeMotion:
    """Misfits of one joint in free space, block by block, and what follows from them.

    Attributes
    ----------
    bound : float
        Moment in N m that free motion exceeds in 5 % of all blocks; NaN while that is not known.
    least_seen : float
        Moment in N m that a lasting misfit of free motion exceeds once in 20 h.
    """

    def __init__(self) -> None:
        self.bound = self.least_seen = math.nan
        self._misfits: list[float] = []
        self._lasting: list[float] = []
        self._halves: list[float] = []
        self._due = float(LEAST)

    @property
    def is_learnt(self) -> bool:
        """Whether no more is learnt."""
        return len(self._misfits) >= MOST

    def forget(self) -> None:
        """Begin anew; bounds stay until there are others."""
        self._misfits, self._lasting, self._halves = [], [], []
        self._due = float(LEAST)

    def learn(self, misfit: float, lasting: float, half: float, certain: bool) -> None:
        """Add a block by how much zero is outside of its set, and of all of the last ones, N m.

        `half` is the half-width of the set; `certain` that nothing touches the tip. What may be a
        contact too light to be seen makes bounds narrower, and never wider.
        """
        self._misfits.append(misfit)
        self._lasting.append(lasting)
        self._halves.append(half)
        if len(self._misfits) >= self._due:
            self._due *= _GROWN
            bound, least_seen = self._derived()
            if certain or math.isnan(self.bound):
                self.bound, self.least_seen = bound, least_seen
            else:
                self.bound = min(self.bound, bound)
                self.least_seen = min(self.least_seen, least_seen)

    def _derived(self) -> tuple[float, float]:
        ordered = np.sort(self._misfits)
        bound = max(0.0, float(ordered[round(COVERED * len(ordered))]))
        level, excess, clusters, half = self.tail()
        # What exceeds a high level does so by an exponentially distributed amount (Pickands, Ann.
        # Statist. 3(1), 1975, of a light tail), in clusters of which each counts once (Leadbetter,
        # Stat. Probab. Lett. 12, 1991). With the conjugate prior for its mean, as if `n` clusters
        # with a sum of `s` had been seen, the next excess is beyond s (p^(-1/n) - 1) with a chance
        # of p (Geisser, Predictive Inference, 1993).
        n = clusters + PRIOR_CLUSTERS
        seen = clusters * excess + PRIOR_CLUSTERS * PRIOR_EXCESS * half
        rarity = math.log(TAIL * FALSE_ALARM_S / BLOCK_S)
        return bound, max(0.0, level + seen * math.expm1(rarity / n))

    def tail(self) -> tuple[float, float, int, float]:
        """Level of the tail, mean excess over it, clusters, and median half-width; N m."""
        lasting = np.array(self._lasting)
        ordered = np.sort(lasting)
        begin = round((1.0 - TAIL) * len(ordered))
        level = float(ordered[begin - 1])
        above = np.concatenate([[False], lasting > level])
        clusters = max(1, int(np.sum(above[1:] & ~above[:-1])))
        excess = float(np.mean(ordered[begin:])) - level
        return level, excess, clusters, float(np.median(self._halves))

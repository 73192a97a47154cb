"""Guards: wires that are pulled too hard, and motors that do not do what they are told."""

import math
from collections.abc import Sequence

RELEASE = 0.9
SAMPLES = 3
TOLD_RAD = 0.02
"""13 counts of an encoder of 4096.  With the position gain that an XM430-W350 comes with (800, that
is 6.25 of 885 steps of duty for a count) they are worth 9 % of its stall torque of 4.1 N m, or
0.4 N m: several times what wires of 60 N on a pulley of 2.4 mm hold (e-Manual, control table,
Position P Gain)."""
PATIENCE_NS = 300_000_000


class TensionGuard:
    """Says when one of W wires is pulled harder than `ceiling`, in N.

    A wire is over the ceiling once `SAMPLES` readings in a row are: a single spike of a load cell
    is not a tension. A reading that is not a number counts as over the ceiling, for it hides one.
    That is over only after as many at nine tenths of the ceiling, for readings that scatter about
    the ceiling are still of a wire that is pulled too hard.
    """

    def __init__(self, names: Sequence[str], ceiling: float) -> None:
        self._names = tuple(names)
        self._ceiling = ceiling
        self._run = [0] * len(self._names)
        self._clear = 0
        self.peak = 0.0
        self.trouble = ''

    def update(self, tension: Sequence[float]) -> str:
        """Take a reading of all wires (W,) in N; what is wrong, naming the wire, or nothing."""
        high = False
        low = max(tension, default=0.0) <= RELEASE * self._ceiling
        for wire, value in enumerate(tension):
            if math.isfinite(value) and value <= self._ceiling:
                if value > self.peak:
                    self.peak = value
                self._run[wire] = 0
                continue
            high = True
            self._run[wire] += 1
            if math.isfinite(value):
                self.peak = max(self.peak, value)
            if self._run[wire] >= SAMPLES and not self.trouble:
                self.trouble = (
                    f'tension of {self._names[wire]} is {value:.1f} N, '
                    f'over the ceiling of {self._ceiling:.1f} N'
                )
        if self.trouble:
            self._clear = self._clear + 1 if low and not high else 0
            if self._clear >= SAMPLES:
                self.trouble = ''
                self._clear = 0
        return self.trouble


class StandingStill:
    """Compares what J motors are told with what they do.

    A motor fails to answer once its goal has been further than `TOLD_RAD` from what it was when the
    shaft came to rest, for `PATIENCE_NS`, and the shaft has not turned since by more than two
    counts of `resolution` rad. A constant difference does not count: a servo under load stands
    beside its goal.
    """

    def __init__(self, names: Sequence[str], resolution: float) -> None:
        self._names = tuple(names)
        self._still = 2.0 * resolution
        self.restart()

    def restart(self) -> None:
        """Begin again, as where nothing is commanded."""
        self._rest: list[float] = []
        self._goal_at_rest: list[float] = []
        self._told_ns: list[int | None] = []

    def look(
        self, goal: Sequence[float], measured: Sequence[float] | None, measured_ns: int
    ) -> str:
        """Take goal and shaft angles (J,) in rad, measured at a monotonic time in ns.

        Says which motor stands still, and how far it was told to go; empty where all answer.
        """
        if measured is None:
            self.restart()
            return ''
        if not self._rest:
            self._rest, self._goal_at_rest = list(measured), list(goal)
            self._told_ns = [None] * len(self._rest)
        for k, (wanted, shaft) in enumerate(zip(goal, measured, strict=True)):
            if abs(shaft - self._rest[k]) > self._still:
                self._rest[k], self._goal_at_rest[k] = shaft, wanted
            if abs(wanted - self._goal_at_rest[k]) <= TOLD_RAD:
                self._told_ns[k] = None
                continue
            told_ns = self._told_ns[k]
            if told_ns is None:
                self._told_ns[k] = measured_ns
            elif measured_ns - told_ns >= PATIENCE_NS:
                return (
                    f'{self._names[k]} stands still: its goal has gone '
                    f'{abs(wanted - self._goal_at_rest[k]):.2g} rad, and it has not turned for '
                    f'{(measured_ns - told_ns) * 1e-9:.1f} s'
                )
        return ''

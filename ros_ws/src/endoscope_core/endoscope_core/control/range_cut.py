"""Cuts what is asked for to how far a tube can be bent, and reports that it did."""

from collections.abc import Sequence

from endoscope_core.names import JOINTS
from endoscope_core.safety import BendingRange, keep_within, ranges_in_words


class RangeCut:
    """Keeps desired motions within the `ranges` of J joints, and counts what it cuts."""

    def __init__(self) -> None:
        self.count = 0  # commands that were cut
        self._reported = 0
        self._ranges: tuple[BendingRange, ...] = ()  # to which was cut last

    def __call__(
        self, ranges: Sequence[BendingRange], angle: Sequence[float], velocity: Sequence[float]
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Angles (J,) in rad and velocities in rad/s, as :func:`keep_within` gives them."""
        kept = keep_within(ranges, angle, velocity)
        if kept[0] != tuple(angle):
            self.count, self._ranges = self.count + 1, tuple(ranges)
        return kept

    def report(self) -> str:
        """In words that something was cut since the last report; empty if nothing was."""
        before, self._reported = self._reported, self.count
        if before == self.count:
            return ''
        return f'{ranges_in_words(self._ranges, JOINTS)}, more was asked for'

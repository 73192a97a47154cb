"""How far a tube lets its joints be bent, and how what is asked for is cut to that."""

import math
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class BendingRange:
    """Smallest and largest bending angle, rad."""

    low: float
    high: float

    def keep(self, angle: float, velocity: float) -> tuple[float, float]:
        """A desired angle within the range, and its velocity: zero where the angle is cut."""
        within = min(self.high, max(self.low, angle))
        return within, velocity if within == angle else 0.0


def ranges_in_words(ranges: Sequence[BendingRange], joints: Sequence[str]) -> str:
    """How far the joints of these names can be bent, in degrees, as a sentence without its stop."""
    words = ', '.join(
        f'{joint} from {math.degrees(r.low):.0f} to {math.degrees(r.high):.0f} deg'
        for joint, r in zip(joints, ranges, strict=True)
    )
    return f'this tube can be bent: {words}'


def keep_within(
    ranges: Sequence[BendingRange], angle: Sequence[float], velocity: Sequence[float]
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Desired angles (rad) and velocities (rad/s) of J joints, cut where a tube's range ends.

    Nothing is cut where no range is known; where no velocities are given, none are returned.
    """
    if not ranges:
        return tuple(angle), tuple(velocity)
    speeds = velocity or (0.0,) * len(angle)
    kept = [r.keep(a, v) for r, a, v in zip(ranges, angle, speeds, strict=True)]
    return tuple(a for a, _ in kept), tuple(v for _, v in kept) if velocity else ()

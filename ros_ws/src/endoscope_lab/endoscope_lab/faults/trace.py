"""What shafts and goals did around a fault, judged by their stamps."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.rig import MotorFacts
from endoscope_nodes.runtime.streams import JointSample

STILL = 2.0 * 2.0 * np.pi / 4096
"""Two counts of the encoder, in rad: what readings of a shaft at rest may differ by."""

HELD_S = 0.2 + 0.1
"""From silence to the order to hold, and to a servo of the nominal plant that stands.

It is told to hold a pose that was measured while it ran, overshoots it and comes back.
"""

# The slowest motion of the bench leaves STILL within this, its reversals included.
_WINDOW_NS = 300_000_000
_STREAM_NS = 100_000_000
_SPEED_NS = 10_000_000


def goal_step(goals: Sequence[JointSample], motors: MotorFacts) -> tuple[float, float]:
    """Largest step in rad of goals, in stamp order, in a session; and largest over its bound."""
    largest, share = 0.0, 0.0
    for before, after in itertools.pairwise(goals):
        period = after.stamp_ns - before.stamp_ns
        if before.session != after.session or not 0 < period <= _STREAM_NS:
            continue
        step = max(abs(a - b) for a, b in zip(after.position, before.position, strict=True))
        largest = max(largest, step)
        # A step is bounded by the motors' speed times the time between the stamps.
        share = max(share, step / (motors.speed * period * 1e-9))
    return largest, share


class ShaftTrace:
    """Readings of the shafts by stamp, given in any order."""

    def __init__(self, samples: Sequence[JointSample]) -> None:
        samples = sorted(samples, key=lambda sample: sample.stamp_ns)
        self._stamps = np.array([s.stamp_ns for s in samples], dtype=np.int64)
        self._angles: NDArray[np.float64] = np.array([s.position for s in samples]).reshape(
            len(samples), -1
        )

    def step(self, period_ns: int) -> float:
        """Largest step in rad between readings at most this far apart."""
        if len(self._stamps) < 2:
            return 0.0
        near = np.diff(self._stamps) <= period_ns
        steps = np.abs(np.diff(self._angles, axis=0)).max(axis=1)
        return float(steps[near].max(initial=0.0))

    def longest_gap(self) -> float:
        """Longest time in s between two readings."""
        return float(np.diff(self._stamps).max(initial=0)) * 1e-9

    def speed(self) -> float:
        """Largest mean speed in rad/s over 10 ms."""
        ends = np.searchsorted(self._stamps, self._stamps + _SPEED_NS)
        inside = np.flatnonzero(ends < len(self._stamps))
        if not len(inside):
            return 0.0
        ends = ends[inside]
        way = np.abs(self._angles[ends] - self._angles[inside]).max(axis=1)
        took = (self._stamps[ends] - self._stamps[inside]) * 1e-9
        return float((way / took).max())

    def standstill(self, since_ns: int, open_ns: int, until_ns: int) -> tuple[float | None, float]:
        """When in s the shafts came to rest (None: never), and how far in rad they went unasked."""
        # The stamps are those of the fault, of the last word that a session was open, and of the
        # next enable. Rest begins with the first reading from which on the shafts stayed for 0.3 s.
        # The way is the largest until the enable once they had come to rest and no session had been
        # open for `HELD_S`.
        inside = (self._stamps >= since_ns) & (self._stamps < until_ns)
        stamps, angles = self._stamps[inside], self._angles[inside]
        ends = np.searchsorted(stamps, stamps + _WINDOW_NS)
        for k, end in enumerate(ends):
            if end >= len(stamps):
                break
            if np.abs(angles[k:end] - angles[k]).max() <= STILL:
                # Within an open session a hand that was not heard for a while may go on.
                closed = max(k, int(np.searchsorted(stamps, open_ns + HELD_S * 1e9)))
                gone = np.abs(angles[closed:] - angles[closed : closed + 1]).max(initial=0.0)
                return float(stamps[k] - since_ns) * 1e-9, float(gone)
        return None, 0.0

"""Motion of shafts and goals around a fault, by their stamps."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_core.rig import MotorFacts
from endoscope_nodes.runtime.streams import JointSample

STILL = 2.0 * 2.0 * np.pi / 4096
"""Two counts of the encoder, in rad: largest difference of readings of a shaft at rest."""

HELD_S = 0.2 + 0.1
"""From silence to the hold command, and to standstill of a servo of the nominal plant.

The servo holds a pose that was measured in motion, so that it overshoots and returns.
"""

# The slowest motion of the bench leaves STILL within this, its reversals included.
_WINDOW_NS = 300_000_000
_STREAM_NS = 100_000_000
_SPEED_NS = 10_000_000


def goal_step(goals: Sequence[JointSample], motors: MotorFacts) -> tuple[float, float]:
    """Largest step of goals within a session, in rad, and as a share of its bound."""
    largest, share = 0.0, 0.0
    for before, after in itertools.pairwise(goals):
        period = after.stamp_ns - before.stamp_ns
        if before.session != after.session or not 0 < period <= _STREAM_NS:
            continue
        step = max(abs(a - b) for a, b in zip(after.position, before.position, strict=True))
        largest = max(largest, step)
        # The bound is the motors' speed times the time between the stamps.
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
        travel = np.abs(self._angles[ends] - self._angles[inside]).max(axis=1)
        took = (self._stamps[ends] - self._stamps[inside]) * 1e-9
        return float((travel / took).max())

    def standstill(self, since_ns: int, open_ns: int, until_ns: int) -> tuple[float | None, float]:
        """Time in s to standstill (None: never), and travel in rad without an open session."""
        # The stamps are those of the fault, of the last message of an open session, and of the next
        # enable. Standstill starts with the first reading after which the shafts stay for 0.3 s.
        # The travel is the largest before the enable, from standstill on and once no session has
        # been open for `HELD_S`.
        inside = (self._stamps >= since_ns) & (self._stamps < until_ns)
        stamps, angles = self._stamps[inside], self._angles[inside]
        ends = np.searchsorted(stamps, stamps + _WINDOW_NS)
        for k, end in enumerate(ends):
            if end >= len(stamps):
                break
            if np.abs(angles[k:end] - angles[k]).max() <= STILL:
                # Within an open session a hand may continue after a silence.
                closed = max(k, int(np.searchsorted(stamps, open_ns + HELD_S * 1e9)))
                gone = np.abs(angles[closed:] - angles[closed : closed + 1]).max(initial=0.0)
                return float(stamps[k] - since_ns) * 1e-9, float(gone)
        return None, 0.0

"""Where a method says that something is missing, beside where the concealed laws show."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.explanation import Explanation, Verdict
from endoscope_explain.locate.excess import WINDOW_S
from endoscope_explain.locate.locating import locate_effects, locate_unknown
from endoscope_lab.concealed.judge import Case
from endoscope_lab.concealed.readings import in_noise, read

Mask = NDArray[np.bool_]
Intervals = Sequence[tuple[float, float]]


@dataclass(frozen=True)
class Overlap:
    """Windows of `WINDOW_S` that are in a method's regions, and that should be."""

    hits: int
    extra: int
    missed: int
    all: int

    @staticmethod
    def of(said: Mask, true: Mask) -> 'Overlap':
        """Compare windows (W,) that are said with those that are true."""
        hits, extra, missed = (int(np.sum(w)) for w in (said & true, said & ~true, ~said & true))
        return Overlap(hits, extra, missed, len(true))

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 where there is nothing to find or to say."""
        found = 2 * self.hits + self.extra + self.missed
        return 2 * self.hits / found if found else 1.0

    @property
    def f1_of_all(self) -> float:
        """The same, had every window been said."""
        true = self.hits + self.missed
        return 2 * true / (true + self.all) if self.all else 1.0


def pooled(overlaps: Iterable[Overlap]) -> Overlap:
    """All windows of several cases: a false region where nothing is concealed counts too."""
    every = np.array([(o.hits, o.extra, o.missed, o.all) for o in overlaps])
    hits, extra, missed, count = map(int, every.sum(axis=0))
    return Overlap(hits, extra, missed, count)


def changed_windows(case: Case) -> Mask:
    """Windows (W,) in which the laws change some signal by more (rms) than its noise."""
    # That of the described sensors, in readings of 10 ms as a report judges them.
    command, sensors = case.recording.command.values, case.described.sensors
    bare, true = (in_noise(read(p, command).signals(), sensors) for p in (case.bare, case.true))
    end = case.recording.duration
    changed = np.zeros(_count(end), bool)
    for without, with_it in zip(bare, true, strict=True):
        window = (np.arange(len(without)) * end / len(without) / WINDOW_S).astype(int)
        energy = np.bincount(window, (with_it - without) ** 2, len(changed))
        changed |= energy > np.bincount(window, minlength=len(changed))
    return changed


def windows_in(intervals: Intervals, end: float) -> Mask:
    """Windows (W,) up to `end` s whose middle lies in one of the intervals in s."""
    middle = WINDOW_S * (np.arange(_count(end)) + 0.5)
    within = [(low <= middle) & (middle < high) for low, high in intervals]
    return np.any(within, axis=0) if within else np.zeros(len(middle), bool)


def explained_intervals(case: Case, said: Explanation) -> Intervals:
    """Intervals in s at which an explanation says that something is missing."""
    places = locate_effects(case.recording, said.augmented, said.effects)
    if said.verdict is Verdict.UNKNOWN_PHYSICS:
        places += locate_unknown(case.recording, said)
    return [interval for place in places for interval in place.intervals]


def _count(end: float) -> int:
    return int(np.ceil(end / WINDOW_S))

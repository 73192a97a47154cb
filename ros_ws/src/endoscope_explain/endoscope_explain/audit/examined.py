"""A recording on its way through the steps of an audit; its stamps, gaps and runs of samples."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit.finding import AuditReport, Finding
from endoscope_explain.audit.misreading import Misreading
from endoscope_explain.audit.plausibility import Comparison
from endoscope_explain.recording import Array, Mask, RigRecording, Series


@dataclass(frozen=True)
class Examined:
    """What a step of the audit takes and gives: each finds something and puts it right."""

    recorded: RigRecording  # as it came
    recording: RigRecording  # as put right so far
    plant: PlantDescription  # of the recorded joints
    findings: tuple[Finding, ...] = ()
    comparison: Comparison | None = None  # with the plant, of what is long enough
    misreadings: tuple[Misreading, ...] = ()  # that were corrected
    before: AuditReport | None = None  # of the recording of the same set-up before it

    @property
    def noisy(self) -> bool:
        """Whether the readings have noise, as those of a simulation have not."""
        return self.comparison is None or self.comparison.is_noisy()

    def found(self, *findings: Finding, **changed: Any) -> 'Examined':
        """The same with findings added, and what was changed for them."""
        return replace(self, findings=(*self.findings, *findings), **changed)


def without_times(recording: RigRecording, wrong: Callable[[Array], Mask]) -> RigRecording:
    """The recording with no sample valid at wrong times, of (N,) in s, of all or each joint."""
    return recording.with_series(
        {
            name: s.without(wrong(s.time).reshape(len(s.time), -1, *(1,) * (s.values.ndim - 2)))
            for name, s in recording.measured().items()
        }
    )


GAP_FACTOR = 2.5
"""A gap is at least this many usual sample intervals: one lost sample is not one."""


def usual_interval(time: Array) -> float:
    """Return the median interval of increasing stamps in s."""
    return float(np.median(np.diff(time)))


def find_gaps(series: Series, start: float, end: float) -> tuple[tuple[float, float], ...]:
    """From the last sample before to the first one after each gap, in s."""
    usual = usual_interval(series.time)
    step = np.diff(series.time)
    # A stream that jitters as a matter of course is not full of gaps.
    threshold = max(GAP_FACTOR * usual, 3.0 * float(np.quantile(step, 0.99)))
    at = np.flatnonzero(step > threshold)
    gaps = [(float(series.time[i]), float(series.time[i + 1])) for i in at]
    # A topic that begins late or ends early in the recording has a gap there, too.
    margin = max(threshold, 0.1)
    if series.time[0] - start > margin:
        gaps.insert(0, (start, float(series.time[0])))
    if end - series.time[-1] > margin:
        gaps.append((float(series.time[-1]), end))
    return tuple(gaps)


def retimed(series: Series, skew: float, start: float = 0.0) -> Series:
    """Put a series on the common clock; its own ran `1 + skew` times as fast from `start` s."""
    time: Array = start + (series.time - start) / (1.0 + skew)
    return replace(series, time=time)


def runs(mask: Mask) -> list[tuple[int, int]]:
    """First and last place of each run of true values of a mask (N,) of samples."""
    edges = np.flatnonzero(np.diff(np.r_[0, mask, 0]))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]

"""Stamps: out of order, repeated, and missing."""

import numpy as np

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.explanation import Estimate
from endoscope_explain.recording.series import Array, Series

GAP_FACTOR = 2.5
"""A gap is at least this many usual sample intervals: one lost sample is not one."""


def order_stamps(series: Series, joint: str) -> tuple[Series, list[Finding]]:
    """Sort a series by its stamps and keep the first of equal ones; findings name the joint."""
    findings = []
    step = np.diff(series.time)
    backward = step < 0
    if backward.any():
        worst = float(-step.min())
        # Neighbours that changed places are harmless; a clock that was set back is not.
        severity = Severity.FAULT if worst > 0.1 else Severity.NOTE
        first = float(series.time[1:][backward][0])
        findings.append(
            Finding(
                'unordered_stamps',
                severity,
                joint,
                'recording',
                (series.topic,),
                ((first, first + worst),),
                f'{int(backward.sum())} stamps of {series.topic} run backwards, by {worst:.3f} s '
                f'at most (first at {first:.3f} s)',
                'sorted by stamp',
                evidence={'count': float(backward.sum()), 'worst_s': worst},
            )
        )
    order = np.argsort(series.time, kind='stable')
    time = series.time[order]
    fresh = np.r_[True, np.diff(time) > 0]
    repeats = int((~fresh).sum())
    if repeats:
        at = float(time[~fresh][0])
        findings.append(
            Finding(
                'repeated_stamps',
                Severity.NOTE,
                joint,
                'recording',
                (series.topic,),
                ((at, float(time[~fresh][-1])),),
                f'{repeats} stamps of {series.topic} occur more than once (first at {at:.3f} s)',
                'the first of each was kept',
                evidence={'count': float(repeats)},
            )
        )
    return series.taken(order[fresh]), findings


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


def missing_in(
    series: Series, gaps: tuple[tuple[float, float], ...]
) -> tuple[tuple[float, float], ...]:
    """Gaps in which samples were lost, or may have been: a source may also have paused."""
    if series.lost is None:
        return gaps
    after = np.searchsorted(series.time, [b for _, b in gaps])
    # What ends early or begins late has lost nothing that is known of.
    lost = np.append(series.lost, 0)[np.where(after > 0, after, len(series.lost))]
    return tuple(gap for gap, count in zip(gaps, lost, strict=True) if count)


def silence_findings(
    gaps: dict[str, tuple[tuple[float, float], ...]],
    missing: dict[str, tuple[tuple[float, float], ...]],
    joint: str,
) -> list[Finding]:
    """Note where topics were silent although nothing was lost."""
    silent = {t: [gap for gap in found if gap not in missing[t]] for t, found in gaps.items()}
    every = sorted(gap for found in silent.values() for gap in found)
    if not every:
        return []
    topics = tuple(topic for topic, found in silent.items() if found)
    longest = max(b - a for a, b in every)
    return [
        Finding(
            'source_paused',
            Severity.NOTE,
            joint,
            'recording',
            topics,
            tuple(every),
            f'{", ".join(topics)} paused ({len(every)} times, up to {longest:.3f} s): nothing was '
            'lost',
            'nothing is judged where there are no samples',
            evidence={'count': float(len(every)), 'longest_s': longest},
        )
    ]


def gap_findings(
    gaps_by_topic: dict[str, tuple[tuple[float, float], ...]],
    intervals: dict[str, float],
    joint: str,
) -> list[Finding]:
    """At most one `recording_gap`, of all topics, whose `time_s` is where the longest begins."""
    every = [(b - a, a, b, topic) for topic, gaps in gaps_by_topic.items() for a, b in gaps]
    if not every:
        return []
    every.sort(reverse=True)
    length, begin, _, topic = every[0]
    topics = tuple(dict.fromkeys(item[3] for item in every))
    usual = intervals[topic]
    # The first missing sample was due between one interval after the last sample and that sample.
    onset = Estimate(begin + 0.5 * usual, begin, begin + usual, 's')
    missing = {t: sum(b - a - intervals[t] for a, b in g) for t, g in gaps_by_topic.items() if g}
    return [
        Finding(
            showing(Symptom.MISSING_SAMPLES).id,
            Severity.FAULT,
            joint,
            'recording',
            topics,
            tuple(sorted({(a, b) for _, a, b, _ in every})),
            f'samples of {", ".join(topics)} are missing: the longest gap lasts {length:.3f} s '
            f'from {begin:.3f} s',
            'nothing is judged where samples are missing',
            parameters={
                'time_s': onset,
                'duration_s': Estimate(length - usual, max(length - 2 * usual, 0.0), length, 's'),
            },
            evidence={'gaps': float(len(every)), 'missing_s': float(sum(missing.values()))},
        )
    ]

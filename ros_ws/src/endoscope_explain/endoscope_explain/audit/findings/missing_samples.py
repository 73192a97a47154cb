"""Gaps among the samples of a topic: some were lost, or its source paused."""

import numpy as np

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.examined import Examined, find_gaps, usual_interval, without_times
from endoscope_explain.audit.finding import Finding, FindingKind, Severity
from endoscope_explain.explanation import Estimate
from endoscope_explain.recording import MOVES_RAD, RigRecording, Series

MISSING = FindingKind(
    showing(Symptom.MISSING_SAMPLES).id,
    Severity.FAULT,
    'samples of {topics} are missing: the longest gap lasts {longest:.3f} s from {onset:.3f} s',
    'nothing is judged where samples are missing',
)
PAUSED = FindingKind(
    'source_paused',
    Severity.NOTE,
    '{topics} paused ({count:.0f} times, up to {longest_s:.3f} s): nothing was lost',
    'nothing is judged where there are no samples',
)
SETTLING_S = 0.5
"""How long after a gap in the commands the rig's answer is not judged."""

Gaps = dict[str, list[tuple[float, float]]]
"""By topic, from the last sample before to the first one after each, in s."""


def find(seen: Examined) -> Examined:
    """Leave out what was measured while the command is not known."""
    recording, command = seen.recording, seen.recording.command
    every = {s.topic: s for s in (command, *recording.measured().values())}
    start = min(float(s.time[0]) for s in every.values())
    end = max(float(s.time[-1]) for s in every.values())
    gaps = {topic: list(find_gaps(s, start, end)) for topic, s in every.items()}
    # A command is in force until the next one: a master that pauses, or whose clutch is released,
    # leaves nothing out. Only where the command has moved on meanwhile some of it is missing, and
    # not even there if the motors have rested: then it began again from another pose.
    blind = [
        (a, b)
        for a, b in _lost(command, gaps[command.topic])
        if _has_moved_on(command, a, b, end)
        and not _rests(recording.shaft_position, a + SETTLING_S, b)
    ]
    gaps[command.topic] = blind
    lost = {topic: _lost(every[topic], found) for topic, found in gaps.items()}
    silent = {t: [gap for gap in found if gap not in lost[t]] for t, found in gaps.items()}
    found = []
    if any(lost.values()):
        intervals = {topic: usual_interval(s.time) for topic, s in every.items()}
        found.append(_missing(recording, lost, intervals))
    if any(silent.values()):
        pauses = sorted(gap for gaps in silent.values() for gap in gaps)
        topics = [topic for topic, gaps in silent.items() if gaps]
        longest = max(b - a for a, b in pauses)
        evidence = {'count': float(len(pauses)), 'longest_s': longest}
        named = ', '.join(topics)
        found.append(PAUSED.found(recording, topics, pauses, topics=named, evidence=evidence))
    if blind:
        recording = without_times(
            recording,
            lambda t: np.any([(t > a) & (t < b + SETTLING_S) for a, b in blind], axis=0),
        )
    return seen.found(*found, recording=recording)


def _missing(recording: RigRecording, lost: Gaps, intervals: dict[str, float]) -> Finding:
    """One finding of all topics, whose `time_s` is where the longest gap begins."""
    every = sorted(((b - a, a, b, t) for t, gaps in lost.items() for a, b in gaps), reverse=True)
    length, begin, _, topic = every[0]
    topics = tuple(dict.fromkeys(topic for *_, topic in every))
    usual = intervals[topic]
    missing = sum(sum(b - a - intervals[t] for a, b in gaps) for t, gaps in lost.items() if gaps)
    return MISSING.found(
        recording,
        topics,
        sorted({(a, b) for _, a, b, _ in every}),
        topics=', '.join(topics),
        longest=length,
        onset=begin,
        parameters={
            # The first missing sample was due between one interval after the last sample and that
            # sample.
            'time_s': Estimate(begin + 0.5 * usual, begin, begin + usual, 's'),
            'duration_s': Estimate(length - usual, max(length - 2 * usual, 0.0), length, 's'),
        },
        evidence={'gaps': float(len(every)), 'missing_s': float(missing)},
    )


def _lost(series: Series, gaps: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Gaps in which samples were lost, or may have been: a source may also have paused."""
    if series.lost is None:
        return gaps
    after = np.searchsorted(series.time, [b for _, b in gaps])
    # What ends early or begins late has lost nothing that is known of.
    lost = np.append(series.lost, 0)[np.where(after > 0, after, len(series.lost))]
    return [gap for gap, count in zip(gaps, lost, strict=True) if count]


def _has_moved_on(command: Series, begin: float, resumed: float, end: float) -> bool:
    """Whether a command changes by more than its usual step across a gap, in s, amid it."""
    if begin < command.time[0] or resumed >= end:
        return False
    usual = float(np.quantile(np.abs(np.diff(command.values, axis=0)), 0.99))
    before, after = command.values[np.searchsorted(command.time, [begin, resumed])]
    return bool(np.abs(after - before).max() > 2.0 * usual)


def _rests(shaft: Series | None, begin: float, end: float) -> bool:
    """Whether all motors are known to stand still from begin to end, in s."""
    if shaft is None:
        return False
    inside = (shaft.time >= begin) & (shaft.time < end)
    return bool(inside.sum() > 2 and np.ptp(shaft.values[inside], axis=0).max() < MOVES_RAD)

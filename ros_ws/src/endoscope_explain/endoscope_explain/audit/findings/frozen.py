"""Topics, and readings, that stand still though they must move."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import Column, Finding, FindingKind, Severity, column_name
from endoscope_explain.audit.plausibility import Comparison
from endoscope_explain.recording import (
    LEAST_DURATION_S,
    MOTOR,
    MOVES_RAD,
    Array,
    RigRecording,
    Series,
)

KIND = FindingKind(
    'frozen',
    Severity.MISTAKE,
    '{what} is frozen: it repeats one reading from {begin:.3f} s to its end while {meanwhile}',
    'record it again with its source running',
)
LONG_S = 1.0
SHARE = 0.5
"""Part of the recording from whose length on a topic is frozen, not held for a moment."""


def find(seen: Examined) -> Examined:
    """Compare with the plant, by which what stands still must move; see `without`."""
    recording = seen.recording
    if recording.duration < LEAST_DURATION_S:
        return seen
    comparison = Comparison(recording, seen.plant)
    seen = replace(seen, comparison=comparison)
    findings = []

    def freeze(columns: Sequence[Column], since: float, what: str) -> None:
        meanwhile = 'the motors move' if columns[0][0] == 'command' else 'the command moves'
        span = [(since, recording.duration)]
        finding = KIND.found(recording, columns, span, what=what, meanwhile=meanwhile)
        findings.append(finding)

    by_topic: dict[str, dict[str, Series]] = {}
    for quantity, series in recording.measured().items():
        by_topic.setdefault(series.topic, {})[quantity] = series
    for topic, held in by_topic.items():
        time = next(iter(held.values())).time
        values = np.concatenate([s.values.reshape(len(time), -1) for s in held.values()], axis=1)
        columns = [(q, c) for q, s in held.items() for c in range(s.values[0].size)]
        since = _unchanged_since(time, values)
        # Of a recording that shows no noise, a slack wire and a joint that is held fast may well
        # give one reading.
        sure = seen.noisy or topic == MOTOR
        if sure and since is not None and any(comparison.must_move(c, since) for c in columns):
            freeze(columns, since, topic)
            continue
        begin = float(time[0])
        for column, value in zip(columns, values.T, strict=True):
            # An encoder of a motor that is held fast stands still as well.
            sure = seen.noisy and topic != MOTOR
            if sure and np.ptp(value) == 0.0 and comparison.must_move(column, begin):
                freeze([column], begin, column_name(recording, column))
    command = recording.command
    if not moves(command) and moves(recording.shaft_position):
        every = [('command', j) for j in range(len(recording.joints))]
        freeze(every, float(command.time[0]), command.topic)
    return seen.found(*findings)


def moves(series: Series | None) -> bool:
    """Whether any column of shaft angles moves."""
    return series is not None and bool(np.ptp(series.values, axis=0).max() >= MOVES_RAD)


def without(recording: RigRecording, frozen: Sequence[Finding]) -> RigRecording:
    """The recording without what stood still; a motor that did is as one that was not recorded."""
    since = {signal: f.intervals[0][0] for f in frozen for signal in f.signals}
    changed: dict[str, Any] = {}
    for quantity, series in recording.measured().items():
        columns = range(series.values[0].size)
        begins = [since.get(column_name(recording, (quantity, c)), np.inf) for c in columns]
        wrong = (series.time[:, None] >= np.array(begins)).reshape(series.valid.shape)
        stands = series.topic == MOTOR and wrong.any()
        changed[quantity] = None if stands else series.without(wrong)
    return replace(recording, **changed)


def _unchanged_since(time: Array, values: Array) -> float | None:
    """When (N,) in s the last change of values (N, columns) was, where it is long ago."""
    change = np.flatnonzero((np.diff(values, axis=0) != 0.0).any(axis=1))
    since = float(time[change[-1] + 1] if len(change) else time[0])
    long = max(LONG_S, SHARE * float(time[-1] - time[0]))
    return since if float(time[-1]) - since >= long else None

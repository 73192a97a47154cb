"""Stamps that run backwards or repeat themselves."""

from dataclasses import replace

import numpy as np

from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import FindingKind, Severity

UNORDERED = FindingKind(
    'unordered_stamps',
    Severity.NOTE,
    '{count:.0f} stamps of {signals} run backwards, by {worst_s:.3f} s at most '
    '(first at {begin:.3f} s)',
    'sorted by stamp',
)
SET_BACK = replace(UNORDERED, severity=Severity.FAULT)
"""Neighbours that changed places are harmless; a clock that was set back is not."""
REPEATED = FindingKind(
    'repeated_stamps',
    Severity.NOTE,
    '{count:.0f} stamps of {signals} occur more than once (first at {begin:.3f} s)',
    'the first of each was kept',
)


def find(seen: Examined) -> Examined:
    """Sort each series by its stamps and keep the first of equal ones."""
    recording = seen.recording
    # By topic: position, velocity and effort of the motor come in the same messages.
    found, ordered = {}, {}
    for name, series in {'command': recording.command, **recording.measured()}.items():
        step = np.diff(series.time)
        if (step < 0).any():
            worst, first = float(-step.min()), float(series.time[1:][step < 0][0])
            found[series.topic, UNORDERED.id] = (SET_BACK if worst > 0.1 else UNORDERED).found(
                recording,
                (series.topic,),
                [(first, first + worst)],
                evidence={'count': float((step < 0).sum()), 'worst_s': worst},
            )
        order = np.argsort(series.time, kind='stable')
        time = series.time[order]
        fresh = np.r_[True, np.diff(time) > 0]
        if not fresh.all():
            found[series.topic, REPEATED.id] = REPEATED.found(
                recording,
                (series.topic,),
                [(float(time[~fresh][0]), float(time[~fresh][-1]))],
                evidence={'count': float((~fresh).sum())},
            )
        ordered[name] = series.taken(order[fresh])
    return seen.found(*found.values(), recording=recording.with_series(ordered))

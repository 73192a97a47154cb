"""A clock that runs faster or slower than those of the other topics."""

import numpy as np

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.examined import Examined, retimed
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.explanation import NINETY_PERCENT, Estimate
from endoscope_explain.recording import Series

KIND = FindingKind(
    showing(Symptom.CLOCK_RATE).id,
    Severity.FAULT,
    'the clock behind {signals} runs {way} by {off_ms:.3f} ms in a second',
    'its stamps were put on the common clock',
)
WINDOW_S = 1.0


def find(seen: Examined) -> Examined:
    """Put all topics on the clock that most of them have."""
    recording = seen.recording
    every = {'command': recording.command, **recording.measured()}
    drifts = {s.topic: _drift(s) for s in every.values()}
    known = {topic: drift for topic, drift in drifts.items() if drift is not None}
    if len(known) < 3:
        return seen
    usual = float(np.median([slope for slope, _ in known.values()]))
    skews, found = {}, []
    for topic, (slope, error) in known.items():
        apart = slope - usual
        if abs(apart) > max(6.0 * error, 3e-5):
            skews[topic] = skew = -apart / (1.0 + apart)
            low, high = skew - NINETY_PERCENT * error, skew + NINETY_PERCENT * error
            clock = KIND.found(
                recording,
                (topic,),
                way='fast' if skew > 0 else 'slow',
                off_ms=abs(skew) * 1e3,
                parameters={'skew': Estimate(skew, low, high, '-')},
                evidence={'z': abs(skew) / ((high - low) / (2.0 * NINETY_PERCENT))},
            )
            found.append(clock)
    changed = {name: retimed(s, skews[s.topic]) for name, s in every.items() if s.topic in skews}
    return seen.found(*found, recording=recording.with_series(changed))


def _drift(series: Series) -> tuple[float, float] | None:
    """Drift of receipt against stamp and its standard error in s/s, None if it is unknown."""
    if series.received is None or series.time[-1] - series.time[0] < 5 * WINDOW_S:
        return None
    delay = series.received - series.time
    # The quickest deliveries of each second show the drift.
    window = ((series.time - series.time[0]) / WINDOW_S).astype(int)
    parts = [np.flatnonzero(window == w) for w in np.unique(window)[:-1]]
    slope, error = 0.0, np.inf
    # Against a drift the quickest delivery is the window's last or first: it is taken out first.
    for _ in range(3):
        flat = delay - slope * series.time
        quickest = np.array([part[np.argmin(flat[part])] for part in parts])
        time = series.time[quickest] - series.time[quickest].mean()
        slope = float(time @ delay[quickest] / (time @ time))
        rest = delay[quickest] - delay[quickest].mean() - slope * time
        # Rounding of receipt times would otherwise pass for a precision that nobody has.
        error = max(float(np.std(rest, ddof=2)), 1e-6) / float(np.sqrt(time @ time))
    return slope, error

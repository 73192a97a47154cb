"""Clocks that run apart, from when samples were received."""

from dataclasses import replace

import numpy as np

from endoscope_core.physics.effect import Symptom
from endoscope_core.physics.effects import showing
from endoscope_explain.audit.finding import Finding, Severity
from endoscope_explain.explanation import Estimate
from endoscope_explain.recording.series import Array, Series

WINDOW_S = 1.0


def delay_slope(series: Series) -> tuple[float, float] | None:
    """Drift of receipt against stamp and its standard error in s/s, None if it is unknown."""
    if series.received is None or series.time[-1] - series.time[0] < 5 * WINDOW_S:
        return None
    delay = series.received - series.time
    # The quickest deliveries of each second tell the drift.
    window = ((series.time - series.time[0]) / WINDOW_S).astype(int)
    slope, error = 0.0, np.inf
    # Against a drift the quickest delivery is the window's last or first: it is taken out first.
    for _ in range(3):
        flat = delay - slope * series.time
        quickest = np.array(
            [
                np.flatnonzero(window == w)[np.argmin(flat[window == w])]
                for w in np.unique(window)[:-1]
            ]
        )
        time = series.time[quickest] - series.time[quickest].mean()
        slope = float(time @ delay[quickest] / (time @ time))
        rest = delay[quickest] - delay[quickest].mean() - slope * time
        # Rounding of receipt times would otherwise promise a precision that nobody has.
        error = max(float(np.std(rest, ddof=2)), 1e-6) / float(np.sqrt(time @ time))
    return slope, error


def clock_skew_from_receipt(series: dict[str, Series]) -> dict[str, Estimate]:
    """Skew (relative rate minus one) of topics whose clock surely runs apart from most."""
    slopes = {t: s for t, one in series.items() if (s := delay_slope(one)) is not None}
    if len(slopes) < 3:
        return {}
    usual = float(np.median([slope for slope, _ in slopes.values()]))
    found = {}
    for topic, (slope, error) in slopes.items():
        apart = slope - usual
        if abs(apart) > max(6.0 * error, 3e-5):
            skew = -apart / (1.0 + apart)
            found[topic] = Estimate(skew, skew - 1.645 * error, skew + 1.645 * error, '-')
    return found


def retimed(series: Series, skew: float, start: float = 0.0) -> Series:
    """Put a series on the common clock; its own ran `1 + skew` times as fast from `start` s."""
    time: Array = start + (series.time - start) / (1.0 + skew)
    return replace(series, time=time)


def skew_finding(topic: str, joint: str, skew: Estimate, duration: float) -> Finding:
    """Describe the `clock_skew` of the device behind one topic."""
    way = 'fast' if skew.value > 0 else 'slow'
    return Finding(
        showing(Symptom.CLOCK_RATE).id,
        Severity.FAULT,
        joint,
        'recording',
        (topic,),
        ((0.0, duration),),
        f'the clock behind {topic} runs {way} by {abs(skew.value) * 1e3:.3f} ms in a second',
        'its stamps were put on the common clock',
        parameters={'skew': skew},
        evidence={'z': abs(skew.value) / max((skew.high - skew.low) / 3.29, 1e-12)},
    )

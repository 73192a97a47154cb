"""Stamps that jitter so that readings in motion err by more than their noise."""

import numpy as np

from endoscope_explain.audit.examined import Examined
from endoscope_explain.audit.finding import FindingKind, Severity
from endoscope_explain.audit.plausibility import NORMAL_MEDIAN, sensor_noise
from endoscope_explain.recording import Series

KIND = FindingKind(
    'jittering_stamps',
    Severity.NOTE,
    'stamps of {signals} jitter by {jitter_ms:.3g} ms (rms): in motion readings err by '
    '{times:.2g} times their noise',
    'nothing was put right: stamp readings when they are taken, not received',
)
LEAST_STAMPS = 20
SPEED_WINDOW_S = 0.2


def find(seen: Examined) -> Examined:
    """Note topics whose stamps, as recorded, jitter; stamps in another unit are not judged."""
    if any(f.severity is Severity.MISTAKE for f in seen.findings):
        return seen
    found = []
    noise = sensor_noise(seen.plant.sensors)
    for quantity, series in seen.recorded.measured().items():
        judged = quantity in ('shaft_position', 'tension', 'bending') and noise[quantity]
        if not judged or len(series.time) < LEAST_STAMPS:
            continue
        # A stamp with white jitter is off the middle of its neighbours by the root of 1.5 times as
        # much; the median ignores pauses.
        off_middle = 0.5 * np.abs(np.diff(series.time, n=2))
        jitter = float(np.median(off_middle)) / NORMAL_MEDIAN / np.sqrt(1.5)
        times = jitter * _speed(series) / noise[quantity]
        if times > 1.0:
            signals, evidence = (series.topic,), {'jitter_s': jitter}
            facts = {'jitter_ms': 1e3 * jitter, 'times': times}
            found.append(KIND.found(seen.recorded, signals, evidence=evidence, **facts))
    return seen.found(*found)


def _speed(series: Series) -> float:
    """How fast the quickest column of a series changes (rms), per s."""
    order = np.argsort(series.time, kind='stable')
    grid = np.arange(series.time.min(), series.time.max(), SPEED_WINDOW_S)
    columns = series.values.reshape(len(series.time), -1)[order].T
    moved = np.array([np.diff(np.interp(grid, series.time[order], c)) for c in columns])
    return float(np.sqrt(np.mean(moved**2, axis=1).max())) / SPEED_WINDOW_S if moved.size else 0.0

"""By how much one prediction misses a signal more than another one does, and when that shows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.observe.predicted_signals import SignalView, view
from endoscope_explain.recording import Array, RigRecording


@dataclass(frozen=True)
class SignalExcess:
    """Excess misfit of one signal."""

    view: SignalView
    # (M,): squared residual without the effect minus that with it, in noise units.
    excess: Array
    kept: Array  # (M,), residual with the effect
    missing: Array  # (M,), what the prediction lacks without the effect, in noise units

    @property
    def total(self) -> float:
        """Return the sum of the excess, at least 0."""
        return max(0.0, float(self.excess.sum()))


def excess_between(
    recording: RigRecording, without: PlantDescription, with_it: PlantDescription | None
) -> list[SignalExcess]:
    """What two plants, or one plant and noise alone, miss of each signal, largest excess first."""
    plants = {'without': without} if with_it is None else {'without': without, 'with': with_it}
    found = []
    for one in view(recording, plants).signals.values():
        worse = one.residual('without')
        if with_it is None:
            kept, excess, missing = worse, worse**2 - 1.0, worse
        else:
            kept = one.residual('with')
            excess, missing = worse**2 - kept**2, worse - kept
        found.append(SignalExcess(one, excess, kept, missing))
    return sorted(found, key=lambda e: -e.total)


def shares(excesses: Sequence[SignalExcess]) -> dict[str, float]:
    """Share of the whole excess of each signal, largest first, without the least ones."""
    total = sum(e.total for e in excesses)
    if total <= 0.0:
        return {}
    every = {e.view.signal: e.total / total for e in excesses}
    return {signal: share for signal, share in every.items() if share >= LEAST_SHARE}


WINDOW_S = 0.25
JOIN_S = 0.5
"""Windows closer than this are one interval."""
SIGMAS = 4.0
FAINT = 0.03
LEAST_SHARE = 0.03
MOST_INTERVALS = 12
_LONGEST_LAG = 50


def windowed(excesses: Sequence[SignalExcess], end: float) -> tuple[Array, Array]:
    """Sum the excess of several signals in windows (W,) up to `end` s; and its spread by noise."""
    count = int(np.ceil(end / WINDOW_S))
    sums, variance = np.zeros(count), np.zeros(count)
    for one in excesses:
        index = np.clip((one.view.time / WINDOW_S).astype(int), 0, count - 1)
        sums += np.bincount(index, one.excess, count)
        level = max(1.0, float(np.mean(one.kept**2)))
        # The squares of the noise that is left vary with twice their number, more where it is
        # correlated.
        inflation = 2.0 * level**2 * _correlation_time(one.kept)
        # A difference of predictions d meets noise as 2 d times noise, beside its own square.
        variance += np.bincount(index, inflation + 4.0 * one.missing**2 * level, count)
    return sums, np.sqrt(np.maximum(variance, 1e-12))


def intervals(excesses: Sequence[SignalExcess], end: float) -> tuple[tuple[float, float], ...]:
    """Where the excess stands out of the noise, in s and in order: the strongest twelve."""
    sums, spread = windowed(excesses, end)
    found: list[list[float]] = []
    for w in _strong(sums, spread):
        begin, finish = w * WINDOW_S, min((w + 1) * WINDOW_S, end)
        if found and begin - found[-1][1] < JOIN_S:
            found[-1][1] = finish
            found[-1][2] += sums[w]
        else:
            found.append([begin, finish, sums[w]])
    strongest = sorted(found, key=lambda f: -f[2])[:MOST_INTERVALS]
    return tuple((float(a), float(b)) for a, b, _ in sorted(strongest))


def onset(excesses: Sequence[SignalExcess], driven: Array, end: float) -> float | None:
    """When, in s, a mismatch began that was not there from the start."""
    # A change point of the windowed excess (Page, Biometrika 41, 1954, for one upward change),
    # where `driven` (W, K) are K measures of how much the rig was driven in each window.
    sums, spread = windowed(excesses, end)
    strong = _strong(sums, spread)
    if not len(strong) or strong[0] * WINDOW_S < 0.1 * end:
        return None
    before = slice(0, strong[0])
    # It counts only where nothing stands out before it over at least a tenth of the recording, and
    # where the rig moved as much before as it did when the mismatch showed: what no motion called
    # for has not begun.
    quiet = sums[before].sum() < 3.0 * np.sqrt(np.sum(spread[before] ** 2))
    usual = np.quantile(driven[strong], 0.25, axis=0)
    called_for = bool((driven[before].max(axis=0) > usual).all())
    return float(strong[0] * WINDOW_S) if quiet and called_for else None


def _strong(sums: Array, spread: Array) -> NDArray[np.intp]:
    # Beside a strong effect's main passages its faint traces are significant, but not of interest.
    return np.flatnonzero((sums > SIGMAS * spread) & (sums > FAINT * np.quantile(sums, 0.95)))


def _correlation_time(values: Array) -> float:
    """Sum of the squared autocorrelation of a residual: samples that count as one."""
    centred = values - values.mean()
    power = float(centred @ centred)
    if power <= 0.0 or len(values) < 4:
        return 1.0
    lags = range(1, min(_LONGEST_LAG, len(values) // 4))
    squares = [(float(centred[k:] @ centred[:-k]) / power) ** 2 for k in lags]
    return 1.0 + 2.0 * float(np.sum(squares))

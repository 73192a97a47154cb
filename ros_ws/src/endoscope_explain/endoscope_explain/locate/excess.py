"""By how much one prediction misses a signal more than another one, when, and in which states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from endoscope_core.physics.description import PlantDescription
from endoscope_explain.audit.examined import runs
from endoscope_explain.observe.predicted_signals import SignalView, view
from endoscope_explain.recording import Array, Mask, RigRecording


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


GRID_S = 0.01
AFTER_REVERSAL_RAD = 0.15
"""Travel of the motor (joint-equivalent) that counts as just after a reversal: half misses that a
backlash shows there."""
STANDING_RAD_PER_S = 0.02
"""Speed of the motor (joint-equivalent) up to which it holds, far below that of any wide stroke."""


def conditions(recording: RigRecording, j: int) -> dict[str, Mask]:
    """When joint `j` was in each state (N,), by the state's words as they stand after "shows"."""
    # On a grid of `GRID_S`, those states that hold for some, not all of the time.
    grid = np.arange(0.0, recording.duration, GRID_S)
    motor = _motor(recording, j, grid)
    speed = _speed(motor)
    bending = np.interp(grid, recording.bending.time, _smoothed(recording.bending.values[:, j], 5))
    moving = np.abs(speed) > STANDING_RAD_PER_S
    found = {
        'in holds': _lasting(~moving, 0.2),
        'while the motor moves': moving,
        'while the motor turns in the positive direction': speed > STANDING_RAD_PER_S,
        'while the motor turns in the negative direction': speed < -STANDING_RAD_PER_S,
        'just after reversals': _after_reversal(motor, speed),
    }
    if moving.any():
        slow, fast = np.quantile(np.abs(speed[moving]), [1 / 3, 2 / 3])
        found['at low speed'] = moving & (np.abs(speed) < slow)
        found['at low speed and in holds'] = np.abs(speed) < slow
        found['at high speed'] = np.abs(speed) > fast
    largest = float(np.abs(bending).max())
    for share in (0.3, 0.5, 0.7, 0.85):
        level = share * largest
        degrees = f'{np.degrees(level):.0f} deg'
        found.setdefault(f'beyond {degrees} of bending', np.abs(bending) > level)
        found.setdefault(f'above +{degrees} of bending', bending > level)
        found.setdefault(f'below -{degrees} of bending', bending < -level)
    within = 0.2 * largest
    found[f'within {np.degrees(within):.0f} deg of straight'] = np.abs(bending) < within
    if recording.tension is not None:
        carried = recording.tension.values[:, j].sum(axis=1)
        tension = np.interp(grid, recording.tension.time, carried)
        high = float(np.quantile(tension, 0.75))
        found[f'where the wires carry more than {high:.1f} N'] = tension > high
    for other, name in enumerate(recording.joints):
        if other != j:
            its_speed = _speed(_motor(recording, other, grid))
            found[f'while {name} moves'] = np.abs(its_speed) > STANDING_RAD_PER_S
    for share in (0.25, 0.5, 0.75):
        time = share * recording.duration
        found.setdefault(f'after {time:.0f} s', grid > time)
    return {words: active for words, active in found.items() if 0.02 < active.mean() < 0.98}


def drive(recording: RigRecording, j: int, end: float) -> Array:
    """Largest motor angle and speed, joint-equivalent, and bending angle in windows (W, 3)."""
    count = int(np.ceil(end / WINDOW_S))
    grid = (np.arange(count * int(WINDOW_S / GRID_S), dtype=np.float64) + 0.5) * GRID_S
    motor = _motor(recording, j, grid)
    bending = np.interp(grid, recording.bending.time, recording.bending.values[:, j])
    every = np.abs(np.c_[motor, _speed(motor), bending]).reshape(count, -1, 3)
    return np.asarray(every.max(axis=1))


def _motor(recording: RigRecording, j: int, grid: Array) -> Array:
    source = recording.shaft_position or recording.command
    return np.interp(grid, source.time, source.values[:, j]) / recording.gear


def _speed(angle: Array) -> Array:
    return np.gradient(_smoothed(angle, 5), GRID_S)


def _smoothed(values: Array, width: int) -> Array:
    padded = np.pad(values, width // 2, mode='edge')
    return np.convolve(padded, np.ones(width) / width, 'valid')


def _lasting(active: Mask, shortest: float) -> Mask:
    """Keep the stretches of at least `shortest` s."""
    kept = np.zeros(len(active), bool)
    for first, last in runs(active):
        kept[first : last + 1] = (last + 1 - first) * GRID_S >= shortest
    return kept


def _after_reversal(motor: Array, speed: Array) -> Mask:
    active = np.zeros(len(motor), bool)
    way, turned_at = 0.0, -np.inf
    for i, v in enumerate(speed):
        if abs(v) > STANDING_RAD_PER_S and np.sign(v) != way:
            turned_at = motor[i] if way else -np.inf
            way = float(np.sign(v))
        active[i] = abs(motor[i] - turned_at) < AFTER_REVERSAL_RAD
    return active


LEAST_NATS = 0.08
"""Information that a state must give about where the excess is to be worth a word: half or double
changes the words of one mismatch in 30."""
SHIFTS = 99
"""Of the excess in time; a state is named where at most a tenth of them show as much."""


def regime_in_words(excesses: Sequence[SignalExcess], states: Mapping[str, Mask]) -> str:
    """Name the one or two states, of `conditions`, that hold most of the excess in least time."""
    if not states or not excesses:
        return 'throughout'
    energy = _energy_on_grid(excesses, len(next(iter(states.values()))))
    everywhere = np.ones(len(energy), bool)
    # How far a state concentrates the excess is the Kullback-Leibler divergence between its share
    # of the excess and its share of the time; by chance is what shifts of the excess in time reach.
    first = _best(energy, states, everywhere, 0)
    if first is None:
        return 'throughout'
    rest = {words: active for words, active in states.items() if words != first}
    second = _best(energy, rest, states[first], 1)
    return first if second is None else f'{first}, {second}'


def information(energy: Array, active: Mask, within: Mask) -> float:
    """What a state shows of where the energy (N,), >= 0, is, in nats; 0 where it holds less."""
    total = float(energy[within].sum())
    inside = active & within
    time_share = int(inside.sum()) / max(int(within.sum()), 1)
    if total <= 0.0 or not 0.02 < time_share < 0.98:
        return 0.0
    share = float(np.clip(energy[inside].sum() / total, 1e-9, 1 - 1e-9))
    if share <= time_share:
        return 0.0
    return float(
        share * np.log(share / time_share) + (1 - share) * np.log((1 - share) / (1 - time_share))
    )


def _best(energy: Array, states: Mapping[str, Mask], within: Mask, seed: int) -> str | None:
    scored = {words: information(energy, active, within) for words, active in states.items()}
    # Of states that show as much, the last one is named.
    words, value = max(reversed(scored.items()), key=lambda item: item[1])
    if value < LEAST_NATS:
        return None
    rng = np.random.default_rng(seed)
    least = int(1.0 / GRID_S)
    if len(energy) < 4 * least:
        return words
    shifts = rng.integers(least, len(energy) - least, SHIFTS)
    by_chance = [
        max(information(np.roll(energy, k), active, within) for active in states.values())
        for k in shifts
    ]
    return words if value > np.quantile(by_chance, 0.9) else None


def _energy_on_grid(excesses: Sequence[SignalExcess], size: int) -> Array:
    energy = np.zeros(size)
    for one in excesses:
        index = np.clip((one.view.time / GRID_S).astype(int), 0, size - 1)
        energy += np.bincount(index, one.missing**2, size)
    return energy

"""In which states of the rig, as a person names them, a mismatch shows."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from endoscope_explain.locate.excess import WINDOW_S, SignalExcess
from endoscope_explain.recording import RigRecording

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

GRID_S = 0.01
"""Of the states; fast channels are averaged over as long."""
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
    edges = np.flatnonzero(np.diff(np.r_[False, active, False].astype(int)))
    kept = np.zeros(len(active), bool)
    for a, b in zip(edges[::2], edges[1::2], strict=True):
        if (b - a) * GRID_S >= shortest:
            kept[a:b] = True
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
